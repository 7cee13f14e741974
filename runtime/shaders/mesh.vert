#version 330
uniform mat4 clip_from_world;
uniform mat4 world_from_model;
in vec3 position;
in vec3 normal;
in vec2 uv;
in vec4 tint;  // sRGB curve, as stored
out vec3 v_world;
out vec3 v_normal;
out vec2 v_uv;
out vec4 v_tint;

void main() {
    vec4 world = world_from_model * vec4(position, 1.0);
    gl_Position = clip_from_world * world;
    v_world = world.xyz;
    v_normal = mat3(world_from_model) * normal;
    v_uv = uv;
    v_tint = vec4(mix(tint.rgb / 12.92, pow((tint.rgb + 0.055) / 1.055, vec3(2.4)), step(0.04045, tint.rgb)), tint.a);
}
