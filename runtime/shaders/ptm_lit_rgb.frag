#version 330
#include "srgb.glsl"
#include "ptm_rgb.glsl"
#include "ptm_curve.glsl"
#include "ptm_lights.glsl"

void main() {
    fetch_ptm(v_uv);
    color = vec4(srgb_from_linear(diffuse_light(tangent_frame())), 1.0);
}
