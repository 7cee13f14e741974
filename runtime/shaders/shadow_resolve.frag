#version 330
// The part of a source that is hidden: how many of its points, averaged over places as far apart as the shadows of two
// points are, so that they do not show. 16 places of a sunflower, written out because a loop costs more.
uniform usampler2D bits;  // as shadow_points.glsl makes them
uniform float first_row;  // of the picture that is drawn into
uniform float squash;     // how much shorter a circle on the ground is on screen than wide
out vec4 mark;

uint bits_at(ivec2 at) {
    return texelFetch(bits, clamp(at, ivec2(0), textureSize(bits, 0) - 1), 0).r;
}

// How many bits are set in each byte.
uint counts(uint v) {
    v -= (v >> 1) & 0x55555555u;
    v = (v & 0x33333333u) + ((v >> 2) & 0x33333333u);
    return (v + (v >> 4)) & 0x0F0F0F0Fu;
}

uint points_at(vec2 at, vec2 offset) {
    return counts(bits_at(ivec2(floor(at + offset))) & 0xFFFFFFu);
}

// Of places on four sides together.
uint around(ivec2 at, int x, int y) {
    return bits_at(at + ivec2(x, y)) | bits_at(at + ivec2(-y, x)) | bits_at(at + ivec2(-x, -y)) | bits_at(at + ivec2(y, -x));
}

void main() {
    vec2 at = gl_FragCoord.xy - vec2(0.0, first_row);
    // Beside a shadow nothing says how far apart the steps are, so those are asked that may reach as far as here: the
    // bits of reaches of 4 and of 10 pixels.
    uint near = around(ivec2(at), 4, 0), far = around(ivec2(at), 7, 7);
    uint steps = bits_at(ivec2(at)) | ((near >> 27) & 1u) * near | ((far >> 29) & 1u) * far;
    vec2 reach = exp2((float(counts(steps) >> 24) - 1.0) / 1.5) * vec2(1.0, squash);
    uint sum = 0u;
    sum += points_at(at, reach * vec2(0.190, 0.027)) + points_at(at, reach * vec2(-0.213, 0.234));
    sum += points_at(at, reach * vec2(0.048, -0.367)) + points_at(at, reach * vec2(0.298, 0.398));
    sum += points_at(at, reach * vec2(-0.509, -0.065)) + points_at(at, reach * vec2(0.508, -0.288));
    sum += points_at(at, reach * vec2(-0.152, 0.643)) + points_at(at, reach * vec2(-0.302, -0.581));
    sum += points_at(at, reach * vec2(0.698, 0.277)) + points_at(at, reach * vec2(-0.699, 0.321));
    sum += points_at(at, reach * vec2(0.357, -0.707)) + points_at(at, reach * vec2(0.267, 0.836));
    sum += points_at(at, reach * vec2(-0.752, -0.416)) + points_at(at, reach * vec2(0.910, -0.170));
    sum += points_at(at, reach * vec2(-0.534, 0.806)) + points_at(at, reach * vec2(-0.113, -0.949));
    mark = vec4(float((sum & 0xFFu) + ((sum >> 8) & 0xFFu) + ((sum >> 16) & 0xFFu)) / (16.0 * 24.0));
}
