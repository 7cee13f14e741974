#version 330
// A flat mesh that shadows fall on, in front of itself.
uniform mat4 clip_from_world;
in vec3 position;
in vec4 row_0, row_1, row_2;  // of its world_from_model
out vec3 v_metres;            // as on a ground that nowhere fades

void main() {
    vec4 point = vec4(position, 1.0);
    gl_Position = clip_from_world * vec4(dot(row_0, point), dot(row_1, point), dot(row_2, point), 1.0);
    v_metres = vec3(0.0, 0.0, 1.0);
}
