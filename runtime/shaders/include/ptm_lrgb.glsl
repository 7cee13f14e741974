// An LRGB PTM in two textures: a0..a3; a4, a5 and the red and green parts of the colour, whose parts add up to 1.
uniform sampler2D ptm_0, ptm_1;
uniform vec4 ptm_scale[2], ptm_low[2];
vec4 a0123;
vec2 a45;
vec3 parts;

void hold(vec4 first, vec4 second) {
    a0123 = first * ptm_scale[0] + ptm_low[0];
    second = second * ptm_scale[1] + ptm_low[1];
    a45 = second.xy;
    parts = vec3(second.zw, 1.0 - second.z - second.w);
}

void fetch_ptm(vec2 uv) {
    hold(texture(ptm_0, uv), texture(ptm_1, uv));
}

void fetch_texel(ivec2 texel, int level) {
    hold(texelFetch(ptm_0, texel, level), texelFetch(ptm_1, texel, level));
}

vec3 ptm_value(vec4 w0123, vec2 w45) {
    return (dot(w0123, a0123) + dot(w45, a45)) * parts;
}

// a0..a4 of the luminance.
void luminance_shape(out vec4 shape, out float slope_v) {
    shape = a0123;
    slope_v = a45.x;
}
