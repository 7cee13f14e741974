#version 330
#include "srgb.glsl"
#include "ptm_rgb.glsl"
#include "ptm_curve.glsl"
#include "ptm_lights.glsl"

void main() {
    fetch_ptm(v_uv);
    mat3 frame = tangent_frame();
    if (output_kind == 2)
        color = vec4(view_from_world * ptm_normal(frame) * 0.5 + 0.5, 1.0);
    else
        color = vec4(srgb_from_linear(light_here(frame)), 1.0);
}
