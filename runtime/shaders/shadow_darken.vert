#version 330
// A cell of the picture, laid on the ground plane.
uniform vec2 cell_size;           // in clip space
uniform vec3 ground_depth;        // of the ground at x, y in clip space: linear
uniform mat3 metres_from_screen;  // homogeneous, from the middle of the ground
in vec2 corner;                   // 0..1
in vec2 cell;
out vec3 v_metres;

void main() {
    vec3 at = vec3((cell + corner) * cell_size - 1.0, 1.0);
    gl_Position = vec4(at.xy, dot(ground_depth, at), 1.0);
    v_metres = metres_from_screen * at;
}
