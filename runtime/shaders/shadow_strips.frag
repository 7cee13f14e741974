#version 330
// Marks the shadow of one light; strips that overlap mark it once.
out vec4 mark;

void main() {
    mark = vec4(1.0);
}
