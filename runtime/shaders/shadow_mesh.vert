#version 330
// A polygon mesh pressed along the light onto the ground; one instance draws one copy.
#include "shadow_casting.glsl"
uniform mat4 clip_from_world;
uniform vec4 ground;
uniform vec3 toward_light;
in vec3 position;
in vec2 uv;
in vec4 tint;
in vec4 row_0, row_1, row_2;  // of the copy's world_from_model
out vec2 v_uv;
out float v_alpha;
out float v_out;  // of the ground, metres

void main() {
    vec4 point = vec4(position, 1.0);
    vec3 world = vec3(dot(row_0, point), dot(row_1, point), dot(row_2, point));
    gl_Position = clip_from_world * vec4(on_ground(world, ground, toward_light), 1.0);
    v_uv = uv;
    v_alpha = tint.a;
    v_out = out_of_ground(world, ground);
}
