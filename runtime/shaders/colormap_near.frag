#version 330
// What a fan mirrors of a room of some size. Equals impostor.environment.colormap.
#include "environment.glsl"
#include "rooms.glsl"
#include "colormap_tile.glsl"
uniform mat3x2 level;
uniform sampler2D points;  // where the surface lies that has each normal, from the view's centre, a row for each view
flat in vec3 middle;       // of the view in room space
flat in float size;
flat in int points_row;
const float SHORT_OF_WALL = 0.999;

void main() {
    Room room = room_at(0);
    int code = code_here();
    vec4 normal = normal_of(code);  // w: the part of the light that is mirrored
    vec3 point = middle + size * turned(texelFetch(points, ivec2(code, points_row), 0).xyz);
    // A point that lies beyond the wall, though the centre does not, is moved to just inside.
    vec3 kept = is_sphere(room) ? point * min(SHORT_OF_WALL / max(length(point), 1e-12), 1.0)
                                : clamp(point, -SHORT_OF_WALL, SHORT_OF_WALL);
    bool inside;
    vec3 toward = local_toward(room, within(room, middle) ? kept : point, normalize(mirrored_at(normal.xyz)), inside);
    vec3 seen = normal.w * room.environment_scale.w * texel_of(level, on_face(toward));
    write(code < 225 ? 1.0 : 0.0, inside ? seen : vec3(room.right.w, room.up.w, room.back.w));
}
