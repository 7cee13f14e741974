uniform sampler2D marks;   // one light a channel, four lights a picture, the pictures one above the other
uniform vec2 mark_origin;  // of the viewport
uniform vec2 fade;         // metres from the middle of the ground where it starts and where nothing is left
in vec3 v_metres;          // homogeneous

vec4 mark_at(float first_row) {
    // Marks lie on the corners of pixels: half way between four of them, the fetch is their mean.
    vec2 at = gl_FragCoord.xy - mark_origin + vec2(0.5, 0.5 + first_row);
    return textureLod(marks, at / vec2(textureSize(marks, 0)), 0.0);
}

vec4 factor_from(vec3 light) {
    // The ground is on the sRGB curve, close to a power of 2.2, under which factors multiply.
    vec3 factor = pow(max(light, 0.0), vec3(1.0 / 2.2));
    float gone = smoothstep(fade.x, fade.y, length(v_metres.xy / v_metres.z));
    return vec4(mix(factor, vec3(1.0), gone), 1.0);
}
