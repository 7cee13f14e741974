#version 330
#include "surface.glsl"
in vec2 v_uv;
in float v_alpha;
in float v_out;
out vec4 mark;

void main() {
    if (v_out < 0.0 || cut_out(v_uv, v_alpha)) discard;
    mark = vec4(1.0);
}
