#version 330
// Takes from the ground the part of its light that the marked lights gave; any number of them.
#include "shadow_marks.glsl"
#include "shadow_fade.glsl"
uniform int pictures;
uniform float rows;      // of a picture
uniform vec3 share[32];  // each light's part of the ground's linear light
out vec4 factor;

void main() {
    vec3 light = vec3(1.0);
    for (int picture = 0; picture < pictures; ++picture) {
        vec4 mark = mark_at(picture * rows);
        for (int channel = 0; channel < 4; ++channel)
            light -= mark[channel] * share[4 * picture + channel];
    }
    factor = faded(factor_from(light));
}
