#version 330
// Shows the normals themselves: the colormap holds them as colours.
#include "relit.glsl"

void main() {
    ivec2 texel = texel_here();
    vec2 normal = texelFetch(fan_normal, texel, v_level).rg;
    relit = vec4(colormap_entry(normal.r, 0).rgb, 1.0) * normal.g;
    depth = depth_at(texel);
}
