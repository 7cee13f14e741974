#version 330
// Where there is one albedo an entry is the finished colour, on the sRGB curve.
#include "srgb.glsl"
uniform sampler2D made;  // light, in tiles of the first halves only
flat in ivec2 origin, origin_in_made;
out vec4 light;

void main() {
    vec4 linear = texelFetch(made, ivec2(gl_FragCoord.xy) - origin + origin_in_made, 0);
    light = vec4(srgb_from_linear(linear.rgb), linear.a);
}
