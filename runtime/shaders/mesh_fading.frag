#version 330
// The mesh's pixels of a crossfade.
#include "srgb.glsl"
#include "lights.glsl"
#include "surface.glsl"
#include "mesh_color.glsl"
#include "crossfade.glsl"

void main() {
    if (!keeps_pixel() || cut_out(v_uv, v_tint.a)) discard;
    vec3 toward_eye = toward_the_eye();
    color = mesh_color(seen_normal(v_normal, toward_eye), toward_eye, vec3(0.0), vec3(0.0), 0.0);
}
