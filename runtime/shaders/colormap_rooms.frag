#version 330
// As colormap.frag, among several rooms.
#include "srgb.glsl"
#include "lights.glsl"
#include "environment.glsl"
#include "rooms.glsl"
#include "colormap_row.glsl"
#include "colormap_place.glsl"

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    Row row = row_at(texel.y);
    vec3 world = in_world(row, normal_of(texel.x & 255)), diffuse, specular;
    shade(world, row.back, row.gloss, diffuse, specular);
    write_entry(texel.x, row.albedo, diffuse + diffuse_among(place_at(1, texel.y), world), specular);
}
