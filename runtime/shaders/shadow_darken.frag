#version 330
// Takes from the ground the part of its light that the marked lights gave.
const int CHANNELS = 4;
uniform sampler2D marks;  // one light a channel, four lights a picture, the pictures one above the other
uniform int pictures;
uniform vec2 mark_origin; // of the viewport
uniform vec3 share[32];   // each light's part of the ground's linear light
out vec4 factor;

vec4 mark_at(vec2 at, vec2 size, int picture) {
    return texture(marks, (clamp(at, vec2(0.5), size - 0.5) + vec2(0.0, picture * size.y)) / vec2(textureSize(marks, 0)));
}

void main() {
    vec2 at = gl_FragCoord.xy - mark_origin;
    vec2 size = vec2(textureSize(marks, 0)) / vec2(1.0, pictures);
    vec3 light = vec3(1.0);
    for (int picture = 0; picture < pictures; ++picture) {
        // Four bilinear fetches half a pixel away smooth the edge over one pixel.
        vec4 mark = 0.25 * (mark_at(at + vec2(0.5, 0.5), size, picture) + mark_at(at + vec2(-0.5, 0.5), size, picture) +
                            mark_at(at + vec2(0.5, -0.5), size, picture) + mark_at(at - vec2(0.5, 0.5), size, picture));
        for (int channel = 0; channel < CHANNELS; ++channel)
            light -= mark[channel] * share[CHANNELS * picture + channel];
    }
    // The ground is on the sRGB curve, close to a power of 2.2, under which factors multiply.
    factor = vec4(pow(max(light, 0.0), vec3(1.0 / 2.2)), 1.0);
}
