#version 330
#include "srgb.glsl"
#include "lights.glsl"
#include "surface.glsl"
#include "mesh_color.glsl"

void main() {
    if (cut_out(v_uv, v_tint.a)) discard;
    color = mesh_color();
}
