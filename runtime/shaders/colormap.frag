#version 330
// Entry c of a row: what multiplies the albedo of normal code c; entry 256 + c: what is added on top. Where there is
// one albedo, entry c is the finished colour on the sRGB curve.
#include "srgb.glsl"
#include "lights.glsl"
#include "colormap_row.glsl"
uniform bool show_normals;
uniform mat3 view_from_world;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec3 normal = normal_of(texel.x & 255);
    Row row = row_at(texel.y);
    vec3 world = in_world(row, normal);
    if (show_normals) {
        entry = vec4(view_from_world * world * 0.5 + 0.5, 1.0);
        return;
    }
    vec3 diffuse, specular;
    shade(world, row.back, row.gloss, diffuse, specular);
    write_entry(texel.x, row.albedo, diffuse, specular);
}
