#version 330
// Steps 2 to 5 of the strip shadow; equals impostor.shadow_projection.shadow_on_ground.
#include "shadow_casting.glsl"
uniform mat4 clip_from_world;
uniform vec4 ground;        // plane: dot with a homogeneous point is its height
uniform vec3 toward_light;  // unit
in vec3 point;              // step 1: a silhouette pixel at its depth, model space
in vec4 position_scale;     // of the instance
in vec2 turn;               // cosine and sine of its yaw
in vec4 row0, row1, row2, row3;  // steps 3 to 5 in one matrix, world space to homogeneous world space
out float v_out;  // of the ground, metres

void main() {
    vec3 world = placed(point, position_scale, turn);
    vec4 p = vec4(on_ground(world, ground, toward_light), 1.0);
    v_out = out_of_ground(world, ground);
    vec4 at_feet = vec4(dot(row0, p), dot(row1, p), dot(row2, p), dot(row3, p));
    gl_Position = clip_from_world * mix(at_feet, p, above_feet(dot(ground, vec4(world, 1.0)), position_scale.w));
}
