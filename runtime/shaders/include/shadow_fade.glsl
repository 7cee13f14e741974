uniform vec2 fade;  // metres from the middle of the ground where it starts and where nothing is left
in vec3 v_metres;   // homogeneous

vec4 faded(vec4 factor) {
    return mix(factor, vec4(1.0), smoothstep(fade.x, fade.y, length(v_metres.xy / v_metres.z)));
}
