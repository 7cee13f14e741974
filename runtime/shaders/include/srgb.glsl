// Linear light to the sRGB curve, clipped to 0..1 (IEC 61966-2-1). Equals impostor.lighting.srgb_from_linear.
vec3 srgb_from_linear(vec3 linear) {
    vec3 c = clamp(linear, 0.0, 1.0);
    return mix(c * 12.92, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
}
