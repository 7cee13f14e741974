#version 330
// As colormap.frag, in one room that is mirrored.
#include "srgb.glsl"
#include "lights.glsl"
#include "environment.glsl"
#include "rooms.glsl"
#include "reflection.glsl"
#include "colormap_row.glsl"
#include "colormap_place.glsl"
#include "colormap_mirrored.glsl"

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    Row row = row_at(texel.y);
    vec3 normal = normal_of(texel.x & 255), world = in_world(row, normal), diffuse, specular;
    shade(world, row.back, row.gloss, diffuse, specular);
    // A loop that the half that is added never enters: a software rasteriser also runs what an `if` leaves out.
    int multiplies = texel.x < 256 && metal < 1.0 ? 1 : 0;
    for (int i = 0; i < multiplies; ++i) diffuse += diffuse_in(room_at(0), world);
    vec3 mirrored = mirrored_by(room_at(0), row, texel.x & 255, normal, texel.y);
    write_entry(texel.x, row.albedo, mix(diffuse, mirrored, metal), specular + (1.0 - metal) * mirrored);
}
