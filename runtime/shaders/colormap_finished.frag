#version 330
// Where there is one albedo, and lights alone light it, an entry is finished at once.
#include "srgb.glsl"
#include "lights.glsl"
#include "colormap_tile.glsl"
flat in vec2 shine;

void main() {
    vec4 normal = normal_of(code_here());
    vec3 diffuse, specular;
    shade(turned(normal.xyz), z_axis, shine, diffuse, specular);
    light = normal.w * vec4(srgb_from_linear(factor * diffuse + specular), 1.0);
}
