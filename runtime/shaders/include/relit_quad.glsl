// A relit tile, drawn as a plain texture; the baked depth lets fans and meshes intersect.
uniform sampler2D tiles;
uniform sampler2D tile_depth;
uniform float alpha_cutoff;
in vec2 v_uv;
flat in vec2 v_toward_eye;
flat in vec4 v_bounds;
in float v_depth_start;
flat in float v_depth_span;
out vec4 color;

void show_tile() {
    vec2 uv = clamp(v_uv, v_bounds.xy, v_bounds.zw);
    color = textureLod(tiles, uv, 0.0);
    if (color.a < alpha_cutoff) discard;
    // gl_FragCoord holds z / w and 1 / w of the quad; the surface lies this far from it, toward the eye.
    float offset = (v_depth_start + textureLod(tile_depth, uv, 0.0).r * v_depth_span) * gl_FragCoord.w;
    // What reaches past the eye, where w is not positive, is in front of everything.
    float w = max(1.0 + offset * v_toward_eye.y, 1e-6);
    gl_FragDepth = clamp((gl_FragCoord.z + offset * v_toward_eye.x) / w, 0.0, 1.0);
}
