#version 330
// How much light from all around an object keeps from the ground near its feet.
uniform sampler2D footprint;  // of the object lifted by 0, 1, 2 and 3 quarters of its reach
in vec2 v_uv;
flat in vec4 v_weights;
out vec4 mark;

void main() {
    mark = vec4(dot(texture(footprint, v_uv), v_weights));
}
