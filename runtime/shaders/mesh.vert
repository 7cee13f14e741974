#version 330
// One instance draws one copy of a mesh.
uniform mat4 clip_from_world;
in vec3 position;
in vec3 normal;
in vec2 uv;
in vec4 tint;  // sRGB curve, as stored
in vec4 row_0, row_1, row_2;  // of the copy's world_from_model
in vec2 part;                 // of the dither, in a crossfade: which pixels are drawn
in vec4 tangent;              // w: -1 where the picture of bumps is mirrored
in vec2 bump_uv;
out vec3 v_world;
out vec3 v_normal;
out vec3 v_tangent;
flat out float v_mirrored;
out vec2 v_uv;
out vec2 v_bump_uv;
out vec4 v_tint;
flat out vec2 v_part;

void main() {
    vec4 point = vec4(position, 1.0);
    v_world = vec3(dot(row_0, point), dot(row_1, point), dot(row_2, point));
    gl_Position = clip_from_world * vec4(v_world, 1.0);
    v_normal = vec3(dot(row_0.xyz, normal), dot(row_1.xyz, normal), dot(row_2.xyz, normal));
    v_tangent = vec3(dot(row_0.xyz, tangent.xyz), dot(row_1.xyz, tangent.xyz), dot(row_2.xyz, tangent.xyz));
    v_mirrored = tangent.w;
    v_uv = uv;
    v_bump_uv = bump_uv;
    v_tint = vec4(mix(tint.rgb / 12.92, pow((tint.rgb + 0.055) / 1.055, vec3(2.4)), step(0.04045, tint.rgb)), tint.a);
    v_part = part;
}
