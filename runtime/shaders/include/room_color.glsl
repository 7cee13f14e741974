// What a room shows at a point, seen from some way off.
vec4 room_color(vec3 point, vec3 away) {
    Room room = room_at(0);
    vec3 toward = in_room(room, point) - room.captured_at.xyz;
    toward = is_far(room) ? environment_normal(room, away) : toward * room.environment_scale.xyz;
    vec3 light = room.environment_scale.w * light_around(room.environment, toward, 0.0, footprint_of(toward));
    return vec4(srgb_from_linear(light), 1.0);
}
