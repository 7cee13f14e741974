// What a fan mirrors. Equals impostor.environment.colormap.
// One row for each of the colormap's: the view's centre in the world and the instance's scale; the rooms' parts in the
// diffuse light; 1 for the room that is mirrored; the view.
uniform sampler2D places;
uniform sampler2D points;  // where the surface lies that has each normal, from the view's centre, a row for each view
const float SHORT_OF_WALL = 0.999;

vec4 place_at(int column, int row) {
    return texelFetch(places, ivec2(column, row), 0);
}

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

vec3 mirrored_by(Room room, Row row, int code, vec3 normal, int number) {
    vec4 place = place_at(0, number);
    vec3 offset = texelFetch(points, ivec2(code, int(place_at(3, number).x)), 0).xyz;
    vec3 point = place.xyz + place.w * in_world(row, offset);
    vec3 away = in_world(row, 2.0 * normal.z * normal - vec3(0.0, 0.0, 1.0));
    bool inside;
    vec3 toward = direction_toward(around_point(room, place.xyz, point), point, away, inside);
    vec3 light = room.environment_scale.w * light_around(room.environment, toward, reflection.w, 0.0);
    return inside ? fresnel(normal.z) * light : vec3(room.right.w, room.up.w, room.back.w);
}
