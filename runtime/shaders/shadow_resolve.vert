#version 330
// A cell of the marks.
uniform vec2 texel;  // in clip space
uniform float side;  // of a cell, in texels
in vec2 corner;      // 0..1
in vec2 cell;

void main() {
    // Marks lie on the corners of pixels: a cell has one more than pixels.
    gl_Position = vec4((cell * side + corner * (side + 1.0)) * texel - 1.0, 0.0, 1.0);
}
