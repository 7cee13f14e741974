#version 330
#include "srgb.glsl"
#include "ptm_rgb.glsl"
#include "ptm_curve.glsl"
#include "ptm_terms.glsl"
in vec2 v_uv;
out vec4 color;

void main() {
    fetch_ptm(v_uv);
    color = vec4(srgb_from_linear(sum_of_terms()), 1.0);
}
