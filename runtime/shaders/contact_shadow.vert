#version 330
// The rectangle of ground around an object's feet, laid where the viewer sees the feet.
uniform mat4 clip_from_world;
in vec2 corner;  // 0..1
in vec3 origin, along_u, along_v;
in vec4 row0, row1, row2, row3;  // as in shadow_strips.vert
in float lift;   // of the object above the ground: 0 on it, 1 where it leaves no trace
out vec2 v_uv;
flat out vec4 v_weights;

void main() {
    vec4 p = vec4(origin + corner.x * along_u + corner.y * along_v, 1.0);
    gl_Position = clip_from_world * vec4(dot(row0, p), dot(row1, p), dot(row2, p), dot(row3, p));
    v_uv = corner;
    v_weights = max(1.0 - abs(4.0 * lift - vec4(0.0, 1.0, 2.0, 3.0)), 0.0);
}
