#version 330
// As shadow_darken.frag, on a ground that fades out.
#include "shadow_marks.glsl"
#include "shadow_fade.glsl"
uniform vec3 share[4];  // each light's part of the ground's linear light
out vec4 factor;

void main() {
    factor = faded(factor_from(1.0 - mat4x3(share[0], share[1], share[2], share[3]) * mark_at(0.0)));
}
