#version 330
// A cell of the picture, laid on the ground plane.
uniform vec2 cell_size;     // in clip space
uniform vec3 ground_depth;  // of the ground at x, y in clip space: linear
in vec2 corner;             // 0..1
in vec2 cell;

void main() {
    vec2 at = (cell + corner) * cell_size - 1.0;
    gl_Position = vec4(at, dot(ground_depth, vec3(at, 1.0)), 1.0);
}
