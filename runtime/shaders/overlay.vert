#version 330
// A rectangle of pixels, row 0 at the top.
uniform vec2 screen;      // pixels
uniform vec4 rectangle;   // left, top, width, height in pixels
in vec2 corner;           // 0..1, y down
out vec2 v_uv;

void main() {
    vec2 at = (rectangle.xy + corner * rectangle.zw) / screen;
    gl_Position = vec4(2.0 * at.x - 1.0, 1.0 - 2.0 * at.y, 0.0, 1.0);
    v_uv = corner;
}
