uniform sampler2D marks;   // one light a channel, four lights a picture, the pictures one above the other
uniform vec2 mark_origin;  // of the viewport

vec4 mark_at(float first_row) {
    // Marks lie on the corners of pixels: half way between four of them, the fetch is their mean.
    vec2 at = gl_FragCoord.xy - mark_origin + vec2(0.5, 0.5 + first_row);
    return textureLod(marks, at / vec2(textureSize(marks, 0)), 0.0);
}

vec4 factor_from(vec3 light) {
    // The ground is on the sRGB curve, close to a power of 2.2, under which factors multiply.
    return vec4(pow(max(light, 0.0), vec3(1.0 / 2.2)), 1.0);
}
