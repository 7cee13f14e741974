#version 330
// Highlights of directional lights. Equals impostor.lighting.colormap.
#include "lights.glsl"
#include "colormap_tile.glsl"
flat in vec2 shine;

void main() {
    vec4 normal = normal_of(code_here());
    write(normal.w, highlights_of_lights(turned(normal.xyz), z_axis, shine));
}
