#version 330
// Diffuse light of directional lights. Equals impostor.lighting.colormap.
#include "lights.glsl"
#include "colormap_tile.glsl"

void main() {
    vec4 normal = normal_of(code_here());
    write(normal.w, diffuse_of_lights(turned(normal.xyz)));
}
