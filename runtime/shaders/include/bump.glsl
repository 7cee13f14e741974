// A picture of bumps. As in GPU Gems 19, listing 19-2, but that the byte 128 is flat.
uniform sampler2D bump_picture;
uniform float bumpiness;
uniform bool bumps;
in vec3 v_tangent;
flat in float v_mirrored;  // -1 where the picture is

vec3 bumped(vec3 normal) {
    vec3 up = normalize(normal), right = normalize(v_tangent);
    vec2 slope = bumpiness * (texture(bump_picture, v_uv).rg - 128.0 / 255.0);
    return bumps ? up + slope.x * right + slope.y * v_mirrored * cross(up, right) : up;
}
