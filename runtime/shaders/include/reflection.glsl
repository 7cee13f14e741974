// How much a surface mirrors. Equals impostor.environment.reflection.
uniform vec4 reflection;  // strength, least, exponent, roughness
uniform int any_power;    // 1 for an exponent that is neither 4 nor 5

float fresnel(float facing) {
    float grazing = 1.0 - min(abs(facing), 1.0), square = grazing * grazing;
    float power = square * square * (reflection.z < 4.5 ? 1.0 : grazing);
    if (any_power > 0) power = pow(max(grazing, 1e-20), reflection.z);
    return mix(reflection.y, reflection.x, power);
}
