#version 330
// A surface whose light is the same at every point.
uniform mat4 clip_from_world;
uniform mat4 world_from_model;
uniform vec2 tiling;
in vec3 position;
in vec2 uv;
out vec2 v_uv;

void main() {
    gl_Position = clip_from_world * (world_from_model * vec4(position, 1.0));
    v_uv = uv * tiling;
}
