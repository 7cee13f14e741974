// A PTM's value as linear light: impostor.srgb.linear_from_srgb where it is on that curve, by a polynomial that is off by
// at most 0.28 / 255 on the curve, because a power for each light and channel costs a software rasteriser as much as a fetch.
uniform bool on_curve;

vec3 light_of(vec3 value) {
    vec3 v = clamp(value, 0.0, 1.0);
    vec3 high = 3.02295495 + v * (-5.50395731 + v * (5.2649079 - v * 1.89770937));
    return on_curve ? v * (0.07128869 + v * (0.04004612 + v * high)) : v;
}
