#version 330
uniform mat4 clip_from_world;
in vec3 corner;

void main() {
    gl_Position = clip_from_world * vec4(corner, 1.0);
}
