// What a fan mirrors. Equals impostor.environment.colormap.
uniform sampler2D points;  // where the surface lies that has each normal, from the view's centre, a row for each view
uniform float metal;
const float SHORT_OF_WALL = 0.999;

// The room, moved so that a point that lies beyond its wall, though `center` does not, lies just inside.
Room around_point(Room room, vec3 center, vec3 point) {
    vec3 local = in_room(room, point);
    vec3 kept = is_sphere(room) ? local * min(SHORT_OF_WALL / max(length(local), 1e-12), 1.0)
                                : clamp(local, -SHORT_OF_WALL, SHORT_OF_WALL);
    vec3 shift = within(room, in_room(room, center)) ? kept - local : vec3(0.0);
    room.x.w += shift.x;
    room.y.w += shift.y;
    room.z.w += shift.z;
    return room;
}

// The light around a direction. Equals Environment.mirrored; a fan has no use for a footprint.
vec3 light_toward(vec4 environment, vec3 toward) {
    vec3 place = on_face(toward);
    float level = reflection.w * environment.w, below = min(floor(level), max(environment.w - 1.0, 0.0));
    float above = min(below + 1.0, environment.w);
    vec3 finer = level_texel(environment, below, below > 0.5 ? 1.0 : 0.0, place);
    return mix(finer, level_texel(environment, above, above > 0.5 ? 1.0 : 0.0, place), level - below);
}

vec3 mirrored_by(Room room, Row row, int code, vec3 normal, int number) {
    vec3 away = in_world(row, 2.0 * normal.z * normal - vec3(0.0, 0.0, 1.0)), toward = environment_normal(room, away);
    bool inside = true;
    // A loop that far rooms never enter: a software rasteriser also runs what an `if` leaves out.
    int near = is_far(room) ? 0 : 1;
    for (int i = 0; i < near; ++i) {
        vec4 place = place_at(0, number);
        vec3 offset = texelFetch(points, ivec2(code, int(place_at(3, number).x)), 0).xyz;
        vec3 point = place.xyz + place.w * in_world(row, offset);
        toward = direction_toward(around_point(room, place.xyz, point), point, away, inside);
    }
    vec3 light = room.environment_scale.w * light_toward(room.environment, toward);
    return inside ? fresnel(normal.z) * light : vec3(room.right.w, room.up.w, room.back.w);
}
