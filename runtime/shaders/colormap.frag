#version 330
// Entry c of a row: what multiplies the albedo of normal code c; entry 256 + c: what is added on top. Where there is
// one albedo, entry c is the finished colour on the sRGB curve.
#include "srgb.glsl"
#include "lights.glsl"
uniform sampler2D byte_to_normal;
uniform bool show_normals;
uniform mat3 view_from_world;
flat in vec3 v_right, v_up, v_back;
flat in vec4 v_albedo;
flat in vec2 v_gloss;
out vec4 entry;

void main() {
    int column = int(gl_FragCoord.x);
    vec3 n = texelFetch(byte_to_normal, ivec2(column & 255, 0), 0).xyz;
    if (n == vec3(0.0)) {
        entry = vec4(0.0);
        return;
    }
    vec3 world = v_right * n.x + v_up * n.y + v_back * n.z;
    if (show_normals) {
        entry = vec4(view_from_world * world * 0.5 + 0.5, 1.0);
        return;
    }
    vec3 diffuse, specular;
    shade(world, v_back, v_gloss, diffuse, specular);
    if (v_albedo.w > 0.0)
        entry = vec4(srgb_from_linear(v_albedo.rgb * diffuse + specular), 1.0);
    else
        entry = vec4(column < 256 ? diffuse : specular, 1.0);
}
