#version 330
// One albedo for the whole object: the colormap holds finished colours and one texture is enough.
#include "srgb.glsl"
#include "relit.glsl"

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) + v_shift;
    vec2 normal = texelFetch(fan_normal, texel, v_level).rg;
    relit = vec4(srgb_from_linear(colormap_entry(normal.r, 0).rgb), 1.0) * normal.g;
    depth = depth_at(texel);
}
