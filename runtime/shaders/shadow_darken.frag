#version 330
// Takes from the ground the part of its light that the marked lights gave.
uniform sampler2D marks;  // one light a channel
uniform vec2 mark_origin; // of the viewport
uniform vec3 share[4];    // each light's part of the ground's linear light
out vec4 factor;

void main() {
    vec2 at = gl_FragCoord.xy - mark_origin;
    vec2 texel = 1.0 / vec2(textureSize(marks, 0));
    // Four bilinear fetches half a pixel away smooth the edge over one pixel.
    vec4 mark = 0.25 * (texture(marks, (at + vec2(0.5, 0.5)) * texel) + texture(marks, (at + vec2(-0.5, 0.5)) * texel) +
                        texture(marks, (at + vec2(0.5, -0.5)) * texel) + texture(marks, (at - vec2(0.5, 0.5)) * texel));
    vec3 light = vec3(1.0) - mark.r * share[0] - mark.g * share[1] - mark.b * share[2] - mark.a * share[3];
    // The ground is on the sRGB curve, close to a power of 2.2, under which factors multiply.
    factor = vec4(pow(max(light, 0.0), vec3(1.0 / 2.2)), 1.0);
}
