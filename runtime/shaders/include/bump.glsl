// A picture of bumps. As in GPU Gems 19, listing 19-2, but that the byte 128 is flat.
uniform sampler2D bump_picture;
uniform float bumpiness;
uniform int bumps;  // 0 or 1
in vec3 v_tangent;
flat in float v_mirrored;  // -1 where the picture is

vec3 bumped(vec3 normal) {
    // A loop that a smooth surface never enters: a software rasteriser also runs what an `if` leaves out.
    for (int i = 0; i < bumps; ++i) {
        vec3 up = normalize(normal), right = normalize(v_tangent);
        vec2 slope = bumpiness * (texture(bump_picture, v_uv).rg - 128.0 / 255.0);
        normal = up + slope.x * right + slope.y * v_mirrored * cross(up, right);
    }
    return normal;
}
