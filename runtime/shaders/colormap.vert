#version 330
// One instance fills a run of rows of the colormap texture.
uniform int row_count, columns;
in vec2 corner;
in vec2 span;  // first row and the one after the last

void main() {
    vec2 texel = vec2(corner.x * float(columns), mix(span.x, span.y, corner.y));
    gl_Position = vec4(texel / vec2(512.0, row_count) * 2.0 - 1.0, 0.0, 1.0);
}
