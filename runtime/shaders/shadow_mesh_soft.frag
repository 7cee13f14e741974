#version 330
#include "surface.glsl"
#include "shadow_points.glsl"
in vec2 v_uv;
in float v_alpha;
in float v_out;
flat in uint v_points;
in float v_step;
out uint mark;

void main() {
    if (v_out < 0.0 || cut_out(v_uv, v_alpha)) discard;
    mark = mark_of(v_points, v_step);
}
