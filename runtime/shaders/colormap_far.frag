#version 330
// What a fan mirrors of a room that is far. Equals impostor.environment.colormap.
#include "environment.glsl"
#include "colormap_tile.glsl"
uniform mat3x2 level;

void main() {
    vec4 normal = normal_of(code_here());  // w: the part of the light that is mirrored
    write(normal.w, texel_of(level, on_face(mirrored_at(normal.xyz))));
}
