#version 330
// One instance fills a run of rows of the colormap texture, between two columns.
uniform int row_count;
in vec2 corner;
in vec4 span;  // first column and row, and those after the last

void main() {
    gl_Position = vec4(mix(span.xy, span.zw, corner) / vec2(512.0, row_count) * 2.0 - 1.0, 0.0, 1.0);
}
