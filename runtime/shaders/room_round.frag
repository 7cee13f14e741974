#version 330
// A room's environment on the inner side of a sphere or a cylinder, found within the cube that is drawn.
#include "srgb.glsl"
#include "environment.glsl"
#include "rooms.glsl"
#include "room_color.glsl"
uniform mat4 clip_from_world;
uniform mat4 shape_from_world;
uniform vec4 eye;        // homogeneous
uniform vec3 roundness;  // 1 along the axes in which it is round
in vec3 v_world;
out vec4 color;

void main() {
    // From the point on the cube back to where the line of sight leaves what is round in it.
    vec3 away = eye.w * v_world - eye.xyz, local = (shape_from_world * vec4(v_world, 1.0)).xyz, along = mat3(shape_from_world) * away;
    vec3 across = along * roundness;
    float square = dot(across, across), half_b = dot(local, across), c = dot(local * roundness, local) - 1.0;
    float under = half_b * half_b - square * c;
    float back = min((sqrt(max(under, 0.0)) - half_b) / max(square, 1e-20), 0.0);
    vec3 point = v_world + back * away;
    color = room_color(point, away);
    vec4 clip = clip_from_world * vec4(point, 1.0);
    if (under < 0.0 || abs(local.y + back * along.y) > 1.0001 || clip.w <= 0.0) discard;
    float depth = clamp(clip.z / clip.w * 0.5 + 0.5, 0.0, 1.0);
    gl_FragDepth = mix(gl_DepthRange.near, gl_DepthRange.far, depth);
}
