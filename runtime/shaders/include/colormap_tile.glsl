// An entry of a colormap in its tile, as colormap_tile.vert places it.
uniform sampler2D byte_to_normal;
flat in ivec2 origin;
flat in vec3 factor, x_axis, y_axis, z_axis;
out vec4 light;

int code_here() {
    ivec2 texel = ivec2(gl_FragCoord.xy) - origin;
    return 16 * texel.y + texel.x;
}

// In the axes of the row's view; w is 0 for codes that stand for no normal.
vec4 normal_of(int code) {
    return texelFetch(byte_to_normal, ivec2(code, 0), 0);
}

vec3 turned(vec3 v) {
    return x_axis * v.x + y_axis * v.y + z_axis * v.z;
}

// Where an eye infinitely far away looks by way of a normal.
vec3 mirrored_at(vec3 normal) {
    return turned(2.0 * normal.z * normal - vec3(0.0, 0.0, 1.0));
}

void write(float exists, vec3 value) {
    light = exists * vec4(factor * value, 1.0);
}
