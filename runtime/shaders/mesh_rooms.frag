#version 330
// The diffuse light of a mesh among several rooms.
#include "srgb.glsl"
#include "lights.glsl"
#include "surface.glsl"
#include "environment.glsl"
#include "rooms.glsl"
#include "mesh_color.glsl"
#include "crossfade.glsl"

void main() {
    if (!keeps_pixel() || cut_out(v_uv, v_tint.a)) discard;
    vec3 toward_eye = toward_the_eye(), normal = seen_normal(v_normal, toward_eye);
    vec4 weights, chosen;
    choose_rooms(v_world, weights, chosen);
    color = mesh_color(normal, toward_eye, diffuse_among(weights, normal), vec3(0.0), 0.0);
}
