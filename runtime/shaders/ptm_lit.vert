#version 330
// A surface whose light differs from point to point.
uniform mat4 clip_from_world;
uniform mat4 world_from_model;
uniform vec2 tiling;
in vec3 position;
in vec3 normal;
in vec4 tangent;  // w: -1 where the picture is mirrored
in vec2 uv;
out vec3 v_world;
out vec3 v_normal;
out vec3 v_tangent;
flat out float v_mirror;
out vec2 v_uv;

void main() {
    vec4 world = world_from_model * vec4(position, 1.0);
    gl_Position = clip_from_world * world;
    v_world = world.xyz;
    v_normal = mat3(world_from_model) * normal;
    v_tangent = mat3(world_from_model) * tangent.xyz;
    v_mirror = tangent.w;
    v_uv = uv * tiling;
}
