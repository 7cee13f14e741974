#version 330
// A point of 16 x 16 pixels for each row of a colormap and each half of it: a tile in which light is added up. What is
// the same for a whole row is made ready here.
uniform bool folded;                  // which rows to draw: those with one albedo, or the others
uniform int parts_drawn, row_count;   // 1 or 2: whether both halves of a row have tiles
uniform vec2 parts;                   // of the light: how much of it multiplies the albedo, and how much is added on top
uniform vec4 of_weights, of_chosen;   // how much of it each row's share in the rooms gives
uniform float of_all;                 // and how much every row has
uniform mat3 turn;                    // from the world into the space in which the light is looked up
uniform vec3 shift;
in float number;
in vec3 right, up, back;              // of the fan view as it is turned in the world
in vec4 albedo;                       // linear; w > 0 is one albedo for all
in vec2 gloss;
in vec3 center;                       // of the view in the world
in float scale;
in vec4 weights, chosen;              // each room's part in the diffuse light; 1 for the room that is mirrored
in float view;
flat out ivec2 origin, origin_in_made;
flat out vec3 factor, x_axis, y_axis, z_axis, middle;
flat out vec2 shine;
flat out float size;
flat out int points_row;

void main() {
    int row = int(number), part = gl_InstanceID;
    factor = folded ? albedo.rgb * parts.x + parts.y : vec3(part == 0 ? parts.x : parts.y);
    factor *= of_all + dot(weights, of_weights) + dot(chosen, of_chosen);
    // Equals runtime.fans.colormap_pass.tile_origins.
    origin = 16 * ivec2(row % 2 * parts_drawn + part, row / 2);
    origin_in_made = 16 * ivec2(row % 2, row / 2);
    x_axis = turn * right;
    y_axis = turn * up;
    z_axis = turn * back;
    middle = turn * center + shift;
    shine = gloss;
    size = scale;
    points_row = int(view);
    bool drawn = (albedo.w > 0.0) == folded && factor != vec3(0.0);
    gl_PointSize = 16.0;
    gl_Position = vec4(drawn ? (vec2(origin) + 8.0) / vec2(16 * parts_drawn, 4 * row_count) - 1.0 : vec2(2.0), 0.0, 1.0);
}
