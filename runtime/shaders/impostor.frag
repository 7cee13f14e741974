#version 330
#include "relit_quad.glsl"

void main() {
    show_tile();
}
