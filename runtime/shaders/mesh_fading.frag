#version 330
// The mesh's pixels of a crossfade.
#include "srgb.glsl"
#include "lights.glsl"
#include "surface.glsl"
#include "mesh_color.glsl"
#include "crossfade.glsl"

void main() {
    if (shows_fan() || cut_out(v_uv, v_tint.a)) discard;
    color = mesh_color();
}
