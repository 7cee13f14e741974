// The normals of a PTM, and Blinn-Phong highlights on them. Apart from the diffuse light because a software rasteriser
// pays for what it does not use.
const float TIE = 1e-4;  // as impostor.ptm.normals has it
const float TURN = 6.283185307;
const int HORIZON_SAMPLES = 16;
uniform vec4 eye;  // homogeneous
uniform vec2 gloss;

// How much brighter the texel gets toward a direction on the horizon, along the horizon, and how that bends.
vec2 slope_and_bend(vec2 at, vec4 shape, float slope_v) {
    float twist = shape.x - shape.y, both = at.x * at.y, apart = at.x * at.x - at.y * at.y;
    float linear = shape.w * at.x + slope_v * at.y;
    return vec2(slope_v * at.x - shape.w * at.y - 2.0 * twist * both + shape.z * apart,
                -linear - 2.0 * twist * apart - 4.0 * shape.z * both);
}

// The direction on the horizon under which the texel is brightest: the best of a few, then Newton's method.
vec2 brightest_on_horizon(vec4 shape, float slope_v) {
    vec2 best = vec2(1.0, 0.0);
    float most = -1e30;
    for (int i = 0; i < HORIZON_SAMPLES; ++i) {
        float angle = float(i) * (TURN / float(HORIZON_SAMPLES));
        vec2 at = vec2(cos(angle), sin(angle));
        float value = dot(shape, vec4(at * at, at.x * at.y, at.x)) + slope_v * at.y;
        if (value > most) best = at;
        most = max(most, value);
    }
    const float SPACING = TURN / float(HORIZON_SAMPLES);
    for (int i = 0; i < 4; ++i) {
        vec2 found = slope_and_bend(best, shape, slope_v);
        float turn = found.y < 0.0 ? -found.x / min(found.y, -1e-12) : sign(found.x) * 0.25 * SPACING;
        best = normalize(best + clamp(turn, -SPACING, SPACING) * vec2(-best.y, best.x));
    }
    return best;
}

// Toward the light under which the texel is brightest, in world space. Equals impostor.ptm.normals.
vec3 ptm_normal(mat3 frame) {
    vec4 shape;
    float slope_v;
    luminance_shape(shape, slope_v);
    vec4 sizes = abs(shape);
    shape.xy -= TIE * max(max(max(sizes.x, sizes.y), max(sizes.z, sizes.w)), abs(slope_v)) + 1e-12;
    float bend = 4.0 * shape.x * shape.y - shape.z * shape.z;
    vec2 brightest = vec2(shape.z * slope_v - 2.0 * shape.y * shape.w, shape.z * shape.w - 2.0 * shape.x * slope_v);
    brightest /= bend > 0.0 ? max(bend, 1e-20) : 1.0;
    bool inside = bend > 0.0 && shape.x < 0.0 && dot(brightest, brightest) <= 1.0;
    if (!inside) brightest = brightest_on_horizon(shape, slope_v);
    return frame * vec3(brightest, sqrt(max(1.0 - dot(brightest, brightest), 0.0)));
}

vec3 highlights(vec3 normal, vec3 up) {
    vec3 toward_eye = normalize(eye.xyz - eye.w * v_world), sum = vec3(0.0);
    float square;
    for (int i = 0; i < light_count; ++i) {
        vec3 toward = toward_light(lights[2 * i], square);
        float along = max(dot(normal, normalize(toward + toward_eye)), 0.0);
        float arrives = drop_off(dot(up, toward)) / square * step(0.0, dot(normal, toward));
        sum += lights[2 * i + 1].rgb * (arrives * gloss.x * pow(along, gloss.y));
    }
    return sum;
}
