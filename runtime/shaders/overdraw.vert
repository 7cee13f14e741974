#version 330
// The covered rectangle of one instance's quad.
uniform mat4 clip_from_world;
in vec2 corner;       // 0..1
in vec3 center;       // world
in vec3 right, up;    // world, from the middle of the tile to its edge
in vec4 rectangle;    // the covered part of the tile: left, bottom, right, top in -1..1

void main() {
    vec2 plane = mix(rectangle.xy, rectangle.zw, corner);
    gl_Position = clip_from_world * vec4(center + plane.x * right + plane.y * up, 1.0);
}
