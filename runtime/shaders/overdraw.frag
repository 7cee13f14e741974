#version 330
// Sums go from black through red and yellow to white.
out vec4 color;

void main() {
    color = vec4(0.125, 0.0417, 0.0139, 0.0);
}
