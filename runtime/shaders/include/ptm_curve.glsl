// A PTM's value as linear light. Equals impostor.ptm.relight, then impostor.srgb.linear_from_srgb if it is on that curve.
uniform bool on_curve;

vec3 light_of(vec3 value, float strength) {
    value = clamp(value, 0.0, 1.0) * strength;
    if (!on_curve) return value;
    return mix(value / 12.92, pow((value + 0.055) / 1.055, vec3(2.4)), step(0.04045, value));
}
