#version 330
// A PTM that has been relit already: one plain fetch.
uniform sampler2D relit;
in vec2 v_uv;
out vec4 color;

void main() {
    color = texture(relit, v_uv);
}
