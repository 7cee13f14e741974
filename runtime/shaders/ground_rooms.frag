#version 330
// As ground.frag, where each place is lit by the room that it is in.
#include "srgb.glsl"
#include "lights.glsl"
#include "environment.glsl"
#include "rooms.glsl"
#include "ground_color.glsl"

void main() {
    vec4 weights, chosen;
    choose_rooms(v_world, weights, chosen);
    color = ground_color(diffuse_among(weights, normal));
}
