// The light of a surface at one point, under directional and local lights. Equals impostor.ptm.shading.
const float DROP_OFF = 0.1;  // as impostor.ptm.polynomials has it
const int MOST_LIGHTS = 48;
uniform vec4 lights[2 * MOST_LIGHTS];  // direction toward the light, 0, or position and radius; linear colour
uniform int light_count;
uniform vec3 ambient;        // gain included
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

// How much is left of a light at this height above the surface.
float drop_off(float height) {
    return clamp(1.0 + height / DROP_OFF, 0.0, 1.0);
}

// A light's picture in linear light; from below the surface it is taken on the horizon and fades.
vec3 light_from(vec3 toward) {
    vec2 at = toward.xy / (toward.z < 0.0 ? max(length(toward.xy), 1e-6) : 1.0);
    return light_of(ptm_value(vec4(at * at, at.x * at.y, at.x), vec2(at.y, 1.0))) * drop_off(toward.z);
}

vec3 diffuse_light(mat3 frame) {
    const float THIRD = 1.0 / 3.0;
    vec3 sum = ambient * light_of(ptm_value(vec4(THIRD, THIRD, 0.0, 0.0), vec2(0.0, 1.0)));
    float square;
    for (int i = 0; i < light_count; ++i) {
        vec3 toward = toward_light(lights[2 * i], square);
        sum += lights[2 * i + 1].rgb / square * light_from(toward * frame);
    }
    return sum;
}
