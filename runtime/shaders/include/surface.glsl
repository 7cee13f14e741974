// Albedo and cut-outs of a polygon mesh's material; the bake's shader draws the same surface.
uniform sampler2D base_texture;  // sRGB storage, linear when fetched
uniform vec4 base_color;
uniform int alpha_mode;          // 0 opaque, 1 mask, 2 blend
uniform float alpha_threshold;

// The ordered dither of Bayer, 16 x 16: every aligned block of 4 x 4 samples holds 16 evenly spaced thresholds.
float bayer_threshold(uvec2 pixel) {
    uint rank = 0u;
    for (int bit = 0; bit < 4; ++bit) {
        uvec2 parity = (pixel >> bit) & 1u;
        rank = rank * 4u + (parity.x ^ parity.y) * 2u + parity.y;
    }
    return (float(rank) + 0.5) / 256.0;
}

bool cut_out(vec2 uv, float tint_alpha) {
    if (alpha_mode == 0) return false;
    // Level 0: a mip level's mean alpha would move the edge of the cut-out.
    float alpha = textureLod(base_texture, uv, 0.0).a * base_color.a * tint_alpha;
    if (alpha_mode == 1) return alpha < alpha_threshold;
    return alpha <= bayer_threshold(uvec2(gl_FragCoord.xy));
}

vec3 surface_albedo(vec2 uv, vec3 tint) {
    return texture(base_texture, uv).rgb * base_color.rgb * tint;
}
