#version 330
uniform mat4 clip_from_world;
uniform mat4 world_from_shape;
in vec3 corner;
out vec3 v_world;

void main() {
    vec4 world = world_from_shape * vec4(corner, 1.0);
    v_world = world.xyz;
    gl_Position = clip_from_world * world;
}
