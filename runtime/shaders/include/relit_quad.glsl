// A relit tile, drawn as a plain texture; the baked depth lets fans and meshes intersect.
uniform sampler2D tiles;
uniform sampler2D tile_depth;
uniform float alpha_cutoff;
in vec2 v_uv;
in vec2 v_clip;       // (z + w) / 2 and w in clip space, of a surface at depth 0
flat in vec2 v_step;  // what depth 1 adds to that
out vec4 color;

void show_tile() {
    color = textureLod(tiles, v_uv, 0.0);
    vec2 clip = v_clip + textureLod(tile_depth, v_uv, 0.0).r * v_step;
    // What reaches past the eye, where w is not positive, is in front of everything. Nothing is in front of depth 1:
    // for a rasteriser that is less work than to discard.
    gl_FragDepth = color.a < alpha_cutoff ? 1.0 : clamp(clip.x / max(clip.y, 1e-6), 0.0, 1.0);
}
