#version 330
// Surroundings that are infinitely far away, behind everything.
#include "srgb.glsl"
#include "environment.glsl"
#include "rooms.glsl"
in vec3 v_away;
out vec4 color;

void main() {
    Room room = room_at(0);
    vec3 toward = environment_normal(room, v_away);
    vec3 light = room.environment_scale.w * light_around(room.environment, toward, 0.0, footprint_of(toward));
    color = vec4(srgb_from_linear(light), 1.0);
}
