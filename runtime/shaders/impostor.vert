#version 330
// One instance draws one object: a quad in the plane of its fan view, cut down to what it covers.
uniform mat4 clip_from_world;
uniform vec4 eye;            // homogeneous: w is 0 where it is infinitely far
uniform vec2 cache_size;
in vec2 corner;              // of the covered rectangle, 0..1, y up
in vec3 center;              // world
in vec3 right, up;           // world, from the middle of the tile to its edge
in vec3 back;                // world: the way along which the tile's depth counts
in vec4 rectangle;           // the covered part of the tile: left, bottom, right, top in -1..1
in vec3 place;               // x, y and side of the relit tile in the cache
in vec4 depth;               // metres in front of the quad: at depth 0, from there to depth 1, and per unit of x and y
in vec2 part;                // of the dither, from and to: which pixels are drawn
out vec2 v_uv;
out vec2 v_clip;
flat out vec2 v_step;
flat out vec2 v_part;

void main() {
    vec2 plane = mix(rectangle.xy, rectangle.zw, corner);
    gl_Position = clip_from_world * vec4(center + plane.x * right + plane.y * up, 1.0);
    // Row 0 of a tile is its top: the one flip between images and OpenGL.
    v_uv = (place.xy + (vec2(plane.x, -plane.y) * 0.5 + 0.5) * place.z) / cache_size;
    // Depth along the view's back counts toward the eye as far as the two agree.
    vec3 toward_eye = normalize(eye.xyz - eye.w * center);
    vec4 metre = clip_from_world * vec4(toward_eye * dot(toward_eye, back), 0.0);
    vec4 surface = gl_Position + (depth.x + dot(plane, depth.zw)) * metre;
    v_clip = vec2(0.5 * (surface.z + surface.w), surface.w);
    v_step = depth.y * vec2(0.5 * (metre.z + metre.w), metre.w);
    v_part = part;
}
