#version 330
// A plane, textured or plain, that fades into the background.
#include "srgb.glsl"
#include "lights.glsl"
#include "ground_color.glsl"
uniform vec3 light_of_room;  // the same everywhere

void main() {
    color = ground_color(light_of_room);
}
