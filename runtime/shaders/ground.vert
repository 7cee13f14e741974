#version 330
uniform mat4 clip_from_world;
in vec3 corner;
in vec2 metres;
out vec3 v_world;
out vec2 v_metres;

void main() {
    gl_Position = clip_from_world * vec4(corner, 1.0);
    v_world = corner;
    v_metres = metres;
}
