#version 330
// As shadow_strips.vert, each instance toward its own point of the source and into its own bits of the marks.
#include "shadow_casting.glsl"
#include "shadow_points.glsl"
uniform mat4 clip_from_world;
uniform vec4 ground;        // plane: dot with a homogeneous point is its height
in vec3 point;              // a silhouette pixel at its depth, model space
in vec4 position_scale;     // of the instance
in vec2 turn;               // cosine and sine of its yaw
in vec4 row0, row1, row2, row3;
in vec3 toward_light;
in float step_at_metre;
in uint points;
flat out uint v_points;
out float v_step;
out float v_out;  // of the ground, metres

void main() {
    vec3 world = placed(point, position_scale, turn);
    vec4 p = vec4(on_ground(world, ground, toward_light), 1.0);
    v_out = out_of_ground(world, ground);
    float height = dot(ground, vec4(world, 1.0));
    vec4 at_feet = vec4(dot(row0, p), dot(row1, p), dot(row2, p), dot(row3, p));
    vec4 seen = mix(at_feet, p, above_feet(height, position_scale.w));
    gl_Position = clip_from_world * seen;
    v_points = points;
    v_step = step_between(step_at_metre, height, gl_Position.w / seen.w);
}
