#version 330
// As shadow_mesh.vert: each copy stands in as many instances as the source has points, one after the other.
#include "shadow_casting.glsl"
#include "shadow_points.glsl"
uniform mat4 clip_from_world;
uniform vec4 ground;
uniform int count;               // of points: 24 or a whole part of it
uniform vec3 toward_points[24];  // of the source
uniform float step_at_metre;
in vec3 position;
in vec2 uv;
in vec4 tint;
in vec4 row_0, row_1, row_2;  // of the copy's world_from_model
out vec2 v_uv;
out float v_alpha;
out float v_out;  // of the ground, metres
flat out uint v_points;
out float v_step;

void main() {
    vec4 point = vec4(position, 1.0);
    vec3 world = vec3(dot(row_0, point), dot(row_1, point), dot(row_2, point));
    int number = gl_InstanceID % count;
    gl_Position = clip_from_world * vec4(on_ground(world, ground, toward_points[number]), 1.0);
    v_uv = uv;
    v_alpha = tint.a;
    v_out = out_of_ground(world, ground);
    int width = 24 / count;
    v_points = (0xFFFFFFu >> (24 - width)) << (number * width);
    v_step = step_between(step_at_metre, dot(ground, vec4(world, 1.0)), gl_Position.w);
}
