#version 330
// A viewer's normals as colours.
#include "colormap_tile.glsl"

void main() {
    vec4 normal = normal_of(code_here());
    write(normal.w, turned(normal.xyz) * 0.5 + 0.5);
}
