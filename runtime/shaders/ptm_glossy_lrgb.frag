#version 330
#include "srgb.glsl"
#include "ptm_lrgb.glsl"
#include "ptm_curve.glsl"
#include "ptm_lights.glsl"
#include "ptm_highlights.glsl"
uniform bool show_normals;
uniform mat3 view_from_world;

void main() {
    fetch_ptm(v_uv);
    mat3 frame = tangent_frame();
    vec3 normal = ptm_normal(frame);
    if (show_normals)
        color = vec4(view_from_world * normal * 0.5 + 0.5, 1.0);
    else
        color = vec4(srgb_from_linear(diffuse_light(frame) + highlights(normal, frame[2])), 1.0);
}
