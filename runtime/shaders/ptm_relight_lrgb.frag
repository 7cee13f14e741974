#version 330
// Writes one mip level of the picture of a flat surface, texel by texel.
#include "srgb.glsl"
#include "ptm_lrgb.glsl"
#include "ptm_curve.glsl"
#include "ptm_terms.glsl"
uniform int level;
out vec4 color;

void main() {
    fetch_texel(ivec2(gl_FragCoord.xy), level);
    color = vec4(srgb_from_linear(sum_of_terms()), 1.0);
}
