#version 330
// One instance fills one row of the colormap texture.
uniform int row_count;
in vec2 corner;
in float row;
in vec3 right, up, back;  // the fan view's basis as it is turned in the world
in vec4 albedo;           // linear; w > 0 folds it, and the highlight, into the first 256 entries
in vec2 gloss;            // strength, shininess
flat out vec3 v_right, v_up, v_back;
flat out vec4 v_albedo;
flat out vec2 v_gloss;

void main() {
    v_right = right;
    v_up = up;
    v_back = back;
    v_albedo = albedo;
    v_gloss = gloss;
    float width = albedo.w > 0.0 ? 1.0 : 2.0;
    gl_Position = vec4(corner.x * width - 1.0, (row + corner.y) / float(row_count) * 2.0 - 1.0, 0.0, 1.0);
}
