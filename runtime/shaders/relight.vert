#version 330
// One instance relights one tile of a fan into its place in the tile cache.
uniform vec2 cache_size;
in vec2 corner;
in vec4 place;   // x, y and side in the cache; mip level of the fan
in vec4 part;    // what is drawn of the tile, in its texels: left, top, right, bottom; with the gutter, from -1
in vec3 origin;  // first texel of the tile at that level; row of the colormap
flat out ivec2 v_shift, v_first, v_last;
flat out int v_level, v_row;

void main() {
    v_shift = ivec2(origin.xy) - ivec2(place.xy);
    v_first = ivec2(origin.xy);
    v_last = v_first + int(place.z) - 1;
    v_level = int(place.w);
    v_row = int(origin.z);
    gl_Position = vec4((place.xy + mix(part.xy, part.zw, corner)) / cache_size * 2.0 - 1.0, 0.0, 1.0);
}
