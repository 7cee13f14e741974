// An RGB PTM in five textures: a0..a3 of red; a4, a5 of red and of green; a0..a3 of green; of blue; a4, a5 of blue.
uniform sampler2D ptm_0, ptm_1, ptm_2, ptm_3, ptm_4;
uniform vec4 ptm_scale[2], ptm_low[2];
vec4 red, green, blue, red_green_45;
vec2 blue_45;

void hold(vec4 first, vec4 second, vec4 third, vec4 fourth, vec4 fifth) {
    red = first * ptm_scale[0] + ptm_low[0];
    red_green_45 = second * ptm_scale[1] + ptm_low[1];
    green = third * ptm_scale[0] + ptm_low[0];
    blue = fourth * ptm_scale[0] + ptm_low[0];
    blue_45 = fifth.xy * ptm_scale[1].xy + ptm_low[1].xy;
}

void fetch_ptm(vec2 uv) {
    hold(texture(ptm_0, uv), texture(ptm_1, uv), texture(ptm_2, uv), texture(ptm_3, uv), texture(ptm_4, uv));
}

void fetch_texel(ivec2 texel, int level) {
    hold(texelFetch(ptm_0, texel, level), texelFetch(ptm_1, texel, level), texelFetch(ptm_2, texel, level),
         texelFetch(ptm_3, texel, level), texelFetch(ptm_4, texel, level));
}

vec3 ptm_value(vec4 w0123, vec2 w45) {
    return vec3(dot(w0123, red) + dot(w45, red_green_45.xy), dot(w0123, green) + dot(w45, red_green_45.zw),
                dot(w0123, blue) + dot(w45, blue_45));
}

// a0..a4 of the luminance (Rec. 709).
void luminance_shape(out vec4 shape, out float slope_v) {
    shape = 0.2126 * red + 0.7152 * green + 0.0722 * blue;
    slope_v = 0.2126 * red_green_45.x + 0.7152 * red_green_45.z + 0.0722 * blue_45.x;
}
