// A polygon mesh lit per pixel: the ground truth that a fan is compared with.
uniform vec4 eye;  // homogeneous
uniform vec2 gloss;
uniform int output_kind;  // 0 lit, 1 albedo, 2 view-space normal
uniform mat3 view_from_world;
in vec3 v_world;
in vec3 v_normal;
in vec2 v_uv;
in vec4 v_tint;
out vec4 color;

vec3 toward_the_eye() {
    return normalize(eye.xyz - eye.w * v_world);
}

// The normal of the side that is seen.
vec3 seen_normal(vec3 normal, vec3 toward_eye) {
    normal = normalize(gl_FrontFacing ? normal : -normal);
    // A smooth normal may lean behind the horizon of a face that is still seen: bring it up to the horizon.
    float facing = dot(normal, toward_eye);
    if (facing < 0.0) normal = normalize(normal - facing * toward_eye);
    return normal;
}

// `around` is diffuse light beside that of the lights; `mirrored` what the surface reflects, which a metal colours.
vec4 mesh_color(vec3 normal, vec3 toward_eye, vec3 around, vec3 mirrored, float metal) {
    vec3 albedo = surface_albedo(v_uv, v_tint.rgb);
    vec3 diffuse, specular;
    shade(normal, toward_eye, gloss, diffuse, specular);
    vec3 colored = (1.0 - metal) * (diffuse + around) + metal * mirrored;
    vec3 light = output_kind == 1 ? albedo : albedo * colored + (1.0 - metal) * mirrored + specular;
    return vec4(output_kind == 2 ? view_from_world * normal * 0.5 + 0.5 : srgb_from_linear(light), 1.0);
}
