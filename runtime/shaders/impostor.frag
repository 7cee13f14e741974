#version 330
// A relit tile, drawn as a plain texture; the baked depth lets fans and meshes intersect.
uniform sampler2D tiles;
uniform sampler2D tile_depth;
uniform float alpha_cutoff;
in vec2 v_texel;
in vec2 v_plane_zw;
flat in vec2 v_eye_zw;
flat in vec4 v_bounds;
in float v_depth_start;
flat in float v_depth_span;
uniform vec2 cache_size;
out vec4 color;

void main() {
    vec2 texel = clamp(v_texel, v_bounds.xy, v_bounds.zw);
    color = textureLod(tiles, texel / cache_size, 0.0);
    if (color.a < alpha_cutoff) discard;
    float z = v_depth_start + texelFetch(tile_depth, ivec2(texel), 0).r * v_depth_span;
    vec2 zw = v_plane_zw + z * v_eye_zw;
    gl_FragDepth = clamp(zw.x / zw.y, -1.0, 1.0) * 0.5 + 0.5;
}
