// What a relit tile holds: colour on the sRGB curve, premultiplied by coverage, and depth.
uniform sampler2D fan_normal;  // r: normal code / 255, g: coverage
uniform sampler2D fan_depth;
uniform sampler2D colormap;
flat in ivec2 v_shift, v_first, v_last;
flat in int v_level, v_row;
layout(location = 0) out vec4 relit;
layout(location = 1) out float depth;

// Of the fan; around the tile its edge goes on.
ivec2 texel_here() {
    return clamp(ivec2(gl_FragCoord.xy) + v_shift, v_first, v_last);
}

// As runtime.fans.colormap_pass.ColormapPass lays them out.
vec4 colormap_entry(float code, int table) {
    int number = int(code * 255.0 + 0.5);
    ivec2 tile = ivec2(2 * (v_row & 1) + table, v_row >> 1);
    return texelFetch(colormap, 16 * tile + ivec2(number & 15, number >> 4), 0);
}

float depth_at(ivec2 texel) {
    return texelFetch(fan_depth, (texel << v_level) + ((1 << v_level) >> 1), 0).r;
}
