#version 330
// One instance draws one object: a quad in the plane of its fan view.
uniform mat4 clip_from_world;
uniform vec2 cache_size;
in vec3 corner;       // of the covered rectangle, 0..1, y up; 1 where it is cut along y, 0 along x
in vec3 center;       // world
in vec3 right, up;    // world, from the middle of the tile to its edge
in vec3 toward_eye;   // world: what one metre of depth along the view's back moves the picture toward the eye
in vec4 rectangle;    // the covered part of the tile: left, bottom, right, top in -1..1
in vec4 corner_cuts;  // length of what is cut off: left bottom, right bottom, left top, right top
in vec3 place;        // x, y and side of the relit tile in the cache
in vec4 depth;        // metres in front of the quad: at depth 0, from there to depth 1, and per unit of plane x and y
in float fan_share;   // of the pixels, in a crossfade
out vec2 v_uv;
flat out vec2 v_toward_eye;
flat out vec4 v_bounds;
out float v_depth_start;
flat out float v_depth_span;
flat out float v_fan_share;

void main() {
    // The rectangle without its empty corners: an octagon.
    vec2 bottom_top = corner.x < 0.5 ? corner_cuts.xz : corner_cuts.yw;
    float cut = corner.y < 0.5 ? bottom_top.x : bottom_top.y;
    vec2 inward = (1.0 - 2.0 * corner.xy) * vec2(1.0 - corner.z, corner.z);
    vec2 plane = mix(rectangle.xy, rectangle.zw, corner.xy) + cut * inward;
    gl_Position = clip_from_world * vec4(center + plane.x * right + plane.y * up, 1.0);
    // Row 0 of a tile is its top: the one flip between images and OpenGL.
    v_uv = (place.xy + (vec2(plane.x, -plane.y) * 0.5 + 0.5) * place.z) / cache_size;
    v_bounds = vec4(place.xy + 0.5, place.xy + place.z - 0.5) / cache_size.xyxy;
    vec4 step = clip_from_world * vec4(toward_eye, 0.0);
    v_toward_eye = vec2(0.5 * (step.z + step.w), step.w);
    v_depth_start = depth.x + dot(plane, depth.zw);
    v_depth_span = depth.y;
    v_fan_share = fan_share;
}
