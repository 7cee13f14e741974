// What a row of the colormap is made for, and how its entries are written.
uniform sampler2D byte_to_normal;
// One row for each of the colormap's, 16 numbers: its own number; right, up and back of the fan view as it is turned in
// the world; linear albedo, whose w > 0 folds it and the highlight into the first 256 entries; gloss.
uniform sampler2D rows;
out vec4 entry;

struct Row {
    vec3 right, up, back;
    vec4 albedo;
    vec2 gloss;
};

Row row_at(int number) {
    vec4 a = texelFetch(rows, ivec2(0, number), 0), b = texelFetch(rows, ivec2(1, number), 0);
    vec4 c = texelFetch(rows, ivec2(2, number), 0), d = texelFetch(rows, ivec2(3, number), 0);
    return Row(a.yzw, b.xyz, vec3(b.w, c.xy), vec4(c.zw, d.xy), d.zw);
}

// From the axes of the row's view.
vec3 in_world(Row row, vec3 v) {
    return row.right * v.x + row.up * v.y + row.back * v.z;
}

vec3 normal_of(int code) {
    return texelFetch(byte_to_normal, ivec2(code, 0), 0).xyz;
}

void write_entry(int column, vec4 albedo, vec3 diffuse, vec3 specular) {
    if (albedo.w > 0.0)
        entry = vec4(column < 256 ? srgb_from_linear(albedo.rgb * diffuse + specular) : vec3(0.0), 1.0);
    else
        entry = vec4(column < 256 ? diffuse : specular, 1.0);
}
