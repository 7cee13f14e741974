// The light of a surface at one point, under directional and local lights. Equals impostor.ptm_shading.
const float DROP_OFF = 0.1;  // as impostor.ptm.polynomials has it
uniform sampler2D lights;    // column 0: direction toward the light, 0, or position and radius; column 1: linear colour
uniform int light_count;
uniform vec3 ambient;        // gain included
uniform vec4 eye;            // homogeneous
uniform vec2 gloss;
uniform int output_kind;     // 2: view-space normal
uniform mat3 view_from_world;
in vec3 v_world;
in vec3 v_normal;
in vec3 v_tangent;
flat in float v_mirror;
in vec2 v_uv;
out vec4 color;

// Columns tangent, binormal, normal.
mat3 tangent_frame() {
    vec3 normal = normalize(v_normal);
    vec3 tangent = normalize(v_tangent - dot(v_tangent, normal) * normal);
    return mat3(tangent, v_mirror * cross(normal, tangent), normal);
}

// Unit vector toward a light, and the square of its distance, 1 for a directional one.
vec3 toward_light(vec4 light, out float square) {
    vec3 apart = light.w > 0.0 ? light.xyz - v_world : light.xyz;
    float distance = length(apart);
    square = light.w > 0.0 ? max(distance, light.w) : 1.0;
    square *= square;
    return apart / max(distance, 1e-9);
}

// How much is left of a light at this height above the surface, a little below which it is dark.
float drop_off(float height) {
    return smoothstep(0.0, 1.0, 1.0 + height / DROP_OFF);
}

// A light's picture in linear light.
vec3 light_from(vec3 toward) {
    vec2 at = toward.xy;
    return light_of(ptm_value(vec4(at * at, at.x * at.y, at.x), vec2(at.y, 1.0)), drop_off(toward.z));
}

// Toward the light under which the texel is brightest; world space.
vec3 ptm_normal(mat3 frame) {
    vec4 shape;
    float slope_v;
    luminance_shape(shape, slope_v);
    float bend = 4.0 * shape.x * shape.y - shape.z * shape.z;
    vec2 brightest = vec2(shape.z * slope_v - 2.0 * shape.y * shape.w, shape.z * shape.w - 2.0 * shape.x * slope_v);
    // Where the polynomial has no maximum it is brightest on the horizon.
    bool peak = bend > 1e-6 && shape.x < 0.0;
    brightest = peak ? brightest / max(bend, 1e-6) : vec2(shape.w, slope_v) * 1e6;
    float square = dot(brightest, brightest);
    if (square > 1.0) brightest /= sqrt(square);
    return frame * vec3(brightest, sqrt(max(1.0 - square, 0.0)));
}

vec3 light_here(mat3 frame) {
    const float THIRD = 1.0 / 3.0;
    vec3 sum = ambient * light_of(ptm_value(vec4(THIRD, THIRD, 0.0, 0.0), vec2(0.0, 1.0)), 1.0);
    float square;
    for (int i = 0; i < light_count; ++i) {
        vec3 toward = toward_light(texelFetch(lights, ivec2(0, i), 0), square);
        sum += texelFetch(lights, ivec2(1, i), 0).rgb / square * light_from(toward * frame);
    }
    // A loop of its own that a matt surface never enters: a software rasteriser also runs what an `if` leaves out.
    int highlights = gloss.x > 0.0 ? light_count : 0;
    vec3 normal = highlights > 0 ? ptm_normal(frame) : frame[2];
    vec3 toward_eye = normalize(eye.xyz - eye.w * v_world);
    for (int i = 0; i < highlights; ++i) {
        vec3 toward = toward_light(texelFetch(lights, ivec2(0, i), 0), square);
        float along = max(dot(normal, normalize(toward + toward_eye)), 0.0);
        float above = drop_off(dot(frame[2], toward));
        if (dot(normal, toward) > 0.0)
            sum += texelFetch(lights, ivec2(1, i), 0).rgb / square * above * gloss.x * pow(along, gloss.y);
    }
    return sum;
}
