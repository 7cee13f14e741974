#version 330
// Entry c of a row: what multiplies the albedo of normal code c; entry 256 + c: what is added on top. Where there is
// one albedo, entry c is the finished colour on the sRGB curve.
#include "srgb.glsl"
#include "lights.glsl"
uniform sampler2D byte_to_normal;
// One row for each of the colormap's, 16 numbers: its own number; right, up and back of the fan view as it is turned in
// the world; linear albedo, whose w > 0 folds it and the highlight into the first 256 entries; gloss.
uniform sampler2D rows;
uniform bool show_normals;
uniform mat3 view_from_world;
out vec4 entry;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec3 n = texelFetch(byte_to_normal, ivec2(texel.x & 255, 0), 0).xyz;
    if (n == vec3(0.0)) {
        entry = vec4(0.0);
        return;
    }
    vec4 a = texelFetch(rows, ivec2(0, texel.y), 0), b = texelFetch(rows, ivec2(1, texel.y), 0);
    vec4 c = texelFetch(rows, ivec2(2, texel.y), 0), d = texelFetch(rows, ivec2(3, texel.y), 0);
    vec3 right = a.yzw, up = b.xyz, back = vec3(b.w, c.xy);
    vec4 albedo = vec4(c.zw, d.xy);
    vec3 world = right * n.x + up * n.y + back * n.z;
    if (show_normals) {
        entry = vec4(view_from_world * world * 0.5 + 0.5, 1.0);
        return;
    }
    vec3 diffuse, specular;
    shade(world, back, d.zw, diffuse, specular);
    if (albedo.w > 0.0)
        entry = vec4(texel.x < 256 ? srgb_from_linear(albedo.rgb * diffuse + specular) : vec3(0.0), 1.0);
    else
        entry = vec4(texel.x < 256 ? diffuse : specular, 1.0);
}
