#version 330
uniform sampler2D picture;
uniform bool bottom_up;   // a picture that OpenGL itself drew
in vec2 v_uv;
out vec4 color;

void main() {
    color = texture(picture, bottom_up ? vec2(v_uv.x, 1.0 - v_uv.y) : v_uv);
}
