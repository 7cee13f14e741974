#version 330
uniform mat4 world_from_clip;
uniform vec4 eye;  // homogeneous
in vec3 corner;
out vec3 v_away;

void main() {
    gl_Position = vec4(corner.xy, 1.0, 1.0);
    vec4 far = world_from_clip * gl_Position;
    v_away = far.xyz * eye.w - eye.xyz * far.w;
}
