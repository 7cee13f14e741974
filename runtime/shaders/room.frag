#version 330
// A room's environment on the inner side of something simple, as in GPU Gems 19, listing 19-4.
#include "srgb.glsl"
#include "environment.glsl"
#include "rooms.glsl"
uniform mat4 clip_from_world;
uniform mat4 shape_from_world;
uniform vec4 eye;        // homogeneous
uniform vec3 roundness;  // 0 for a box or plane, that of a sphere, or of a cylinder about y, in the cube that is drawn
in vec3 v_world;
out vec4 color;

void main() {
    // From the point on the cube back to where the line of sight leaves what is round in it.
    vec3 away = eye.w * v_world - eye.xyz, local = (shape_from_world * vec4(v_world, 1.0)).xyz, along = mat3(shape_from_world) * away;
    vec3 across = along * roundness;
    float square = dot(across, across), half_b = dot(local, across), c = dot(local * roundness, local) - 1.0;
    float under = half_b * half_b - square * c;
    float back = min((sqrt(max(under, 0.0)) - half_b) / max(square, 1e-20), 0.0);
    bool round = roundness.x > 0.0;
    vec3 point = v_world + (round ? back : 0.0) * away;
    Room room = room_at(0);
    vec3 toward = in_room(room, point) - room.captured_at.xyz;
    toward = is_far(room) ? environment_normal(room, away) : toward * room.environment_scale.xyz;
    vec3 light = room.environment_scale.w * light_around(room.environment, toward, 0.0, footprint_of(toward));
    vec4 clip = clip_from_world * vec4(point, 1.0);
    bool missed = under < 0.0 || abs(local.y + back * along.y) > 1.0001 || clip.w <= 0.0;
    if (round && missed) discard;
    float depth = clamp(clip.z / clip.w * 0.5 + 0.5, 0.0, 1.0);
    gl_FragDepth = mix(gl_DepthRange.near, gl_DepthRange.far, depth);
    color = vec4(srgb_from_linear(light), 1.0);
}
