#version 330
// A polygon mesh pressed along the light onto the ground.
uniform mat4 clip_from_world;
uniform mat4 world_from_model;
uniform vec4 ground;
uniform vec3 toward_light;
in vec3 position;
in vec2 uv;
in vec4 tint;
out vec2 v_uv;
out float v_alpha;

void main() {
    vec3 world = (world_from_model * vec4(position, 1.0)).xyz;
    float height = dot(ground, vec4(world, 1.0));
    world -= max(height, 0.0) * toward_light / dot(ground.xyz, toward_light) + min(height, 0.0) * ground.xyz;
    gl_Position = clip_from_world * vec4(world, 1.0);
    v_uv = uv;
    v_alpha = tint.a;
}
