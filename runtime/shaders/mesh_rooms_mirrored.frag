#version 330
// A mesh among several rooms that mirrors, or has bumps, or both.
#include "srgb.glsl"
#include "lights.glsl"
#include "surface.glsl"
#include "environment.glsl"
#include "rooms.glsl"
#include "reflection.glsl"
#include "mesh_color.glsl"
#include "bump.glsl"
#include "crossfade.glsl"
uniform bool mirrors;
uniform bool plain_fresnel;
uniform float metal;

void main() {
    if (!keeps_pixel() || cut_out(v_uv, v_tint.a)) discard;
    vec3 toward_eye = toward_the_eye(), normal = seen_normal(bumped(v_normal), toward_eye);
    vec4 weights, chosen;
    choose_rooms(v_world, weights, chosen);
    float part = fresnel(dot(plain_fresnel ? normalize(v_normal) : normal, toward_eye));
    vec3 mirrored = mirrored_in(chosen_room(chosen), v_world, reflect(-toward_eye, normal), reflection.w, part);
    color = mesh_color(normal, toward_eye, diffuse_among(weights, normal), mirrors ? mirrored : vec3(0.0), metal);
}
