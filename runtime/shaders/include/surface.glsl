// Albedo and cut-outs of a polygon mesh's material; the bake's shader draws the same surface.
uniform sampler2D base_texture;  // sRGB storage, linear when fetched
uniform vec4 base_color;
uniform int alpha_mode;          // 0 opaque, 1 mask, 2 blend
uniform float alpha_threshold;

const float BAYER[16] = float[](0., 8., 2., 10., 12., 4., 14., 6., 3., 11., 1., 9., 15., 7., 13., 5.);

bool cut_out(vec2 uv, float tint_alpha) {
    if (alpha_mode == 0) return false;
    // Level 0: a mip level's mean alpha would move the edge of the cut-out.
    float alpha = textureLod(base_texture, uv, 0.0).a * base_color.a * tint_alpha;
    if (alpha_mode == 1) return alpha < alpha_threshold;
    ivec2 cell = ivec2(gl_FragCoord.xy) & 3;
    return alpha <= (BAYER[cell.y * 4 + cell.x] + 0.5) / 16.0;
}

vec3 surface_albedo(vec2 uv, vec3 tint) {
    return texture(base_texture, uv).rgb * base_color.rgb * tint;
}
