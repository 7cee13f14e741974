#version 330
// A room's environment on the inner side of a box, or on a plane, as in GPU Gems 19, listing 19-4.
#include "srgb.glsl"
#include "environment.glsl"
#include "rooms.glsl"
#include "room_color.glsl"
uniform vec4 eye;  // homogeneous
in vec3 v_world;
out vec4 color;

void main() {
    color = room_color(v_world, eye.w * v_world - eye.xyz);
}
