// A picture of bumps, as in GPU Gems 19, listing 19-2, but that the byte 128 is flat; or a normal map, as in
// `impostor.normal_map.mapped_normals` and in the bake's shader.
uniform sampler2D bump_picture;
uniform vec4 bump_weights;  // of the picture along tangent, binormal and normal; of the surface's own normal
uniform bool bumps;
in vec3 v_tangent;
in vec2 v_bump_uv;
flat in float v_mirrored;  // -1 where the picture is

vec3 bumped(vec3 normal) {
    vec3 up = normalize(normal);
    if (!bumps) return up;
    vec3 right = v_tangent / max(length(v_tangent), 1e-6);
    vec3 lean = bump_weights.xyz * (texture(bump_picture, v_bump_uv).rgb - 128.0 / 255.0);
    return lean.x * right + lean.y * v_mirrored * cross(up, right) + max(lean.z + bump_weights.w, 0.01) * up;
}
