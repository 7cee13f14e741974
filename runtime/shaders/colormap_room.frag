#version 330
// As colormap.frag, in one room.
#include "srgb.glsl"
#include "lights.glsl"
#include "environment.glsl"
#include "rooms.glsl"
#include "colormap_row.glsl"

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    Row row = row_at(texel.y);
    vec3 world = in_world(row, normal_of(texel.x & 255)), diffuse, specular;
    shade(world, row.back, row.gloss, diffuse, specular);
    write_entry(texel.x, row.albedo, diffuse + diffuse_in(room_at(0), world), specular);
}
