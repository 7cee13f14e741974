#version 330
// Diffuse light of a room. Equals impostor.environment.colormap.
#include "environment.glsl"
#include "colormap_tile.glsl"
uniform mat3x2 level;

void main() {
    vec4 normal = normal_of(code_here());
    write(normal.w, texel_of(level, on_face(turned(normal.xyz))));
}
