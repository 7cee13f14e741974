#version 330
// Marks the points of a source that are hidden; what is drawn is merged with what is there.
#include "shadow_points.glsl"
flat in uint v_points;
in float v_step;
in float v_out;
out uint mark;

void main() {
    if (v_out < 0.0) discard;
    mark = mark_of(v_points, v_step);
}
