#version 330
// Albedo times the colormap's first half plus its second (equation 2, with a highlight).
#include "srgb.glsl"
#include "relit.glsl"
uniform sampler2D fan_color;  // linear when fetched, premultiplied

void main() {
    ivec2 texel = texel_here();
    float code = texelFetch(fan_normal, texel, v_level).r;
    vec4 albedo = texelFetch(fan_color, texel, v_level);
    vec3 lit = albedo.rgb / max(albedo.a, 1e-4) * colormap_entry(code, 0).rgb + colormap_entry(code, 1).rgb;
    relit = vec4(srgb_from_linear(lit), 1.0) * albedo.a;
    depth = depth_at(texel);
}
