#version 330
// Marks the shadow of one light; strips that overlap mark it once.
in float v_out;
out vec4 mark;

void main() {
    if (v_out < 0.0) discard;
    mark = vec4(1.0);
}
