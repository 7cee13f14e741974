#version 330
// What a fan mirrors of a room that is far. Equals impostor.environment.colormap.
#include "environment.glsl"
#include "reflection.glsl"
#include "colormap_tile.glsl"
#include "colormap_mirrored.glsl"

void main() {
    vec4 normal = normal_of(code_here());
    write(normal.w, fresnel(normal.z) * light_toward(mirrored_at(normal.xyz)));
}
