#version 330
// Takes from the ground the part of its light that the marked lights gave; up to four of them, without a loop.
#include "shadow_marks.glsl"
uniform vec3 share[4];  // each light's part of the ground's linear light
out vec4 factor;

void main() {
    factor = factor_from(1.0 - mat4x3(share[0], share[1], share[2], share[3]) * mark_at(0.0));
}
