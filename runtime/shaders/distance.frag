#version 330
// Distances as greys: white at the eye, black at the horizon.
uniform sampler2D depth;
uniform vec2 unproject;   // row 2 of clip_from_view, columns 2 and 3
uniform float half_grey;  // metres at which the grey is half way
in vec2 v_uv;
out vec4 color;

void main() {
    float stored = texture(depth, vec2(v_uv.x, 1.0 - v_uv.y)).r;
    float metres = unproject.y / (2.0 * stored - 1.0 + unproject.x);
    color = vec4(vec3(stored < 1.0 ? half_grey / (half_grey + metres) : 0.0), 1.0);
}
