#version 330
// As colormap.frag, in one room.
#include "srgb.glsl"
#include "lights.glsl"
#include "environment.glsl"
#include "rooms.glsl"
#include "reflection.glsl"
#include "colormap_row.glsl"
#include "colormap_mirrored.glsl"
uniform float metal;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec3 normal = normal_of(texel.x & 255);
    if (normal == vec3(0.0)) {
        entry = vec4(0.0);
        return;
    }
    Row row = row_at(texel.y);
    vec3 world = in_world(row, normal), mirrored = vec3(0.0), diffuse, specular;
    shade(world, row.back, row.gloss, diffuse, specular);
    diffuse += diffuse_in(room_at(0), world);
    for (int i = 0; i < mirrors; ++i) mirrored = mirrored_by(room_at(0), row, texel.x & 255, normal, texel.y);
    write_entry(texel.x, row.albedo, mix(diffuse, mirrored, metal), specular + (1.0 - metal) * mirrored);
}
