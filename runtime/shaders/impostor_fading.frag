#version 330
// The fan's pixels of a crossfade.
#include "relit_quad.glsl"
#include "crossfade.glsl"

void main() {
    if (!keeps_pixel()) discard;
    show_tile();
}
