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

vec4 mesh_color() {
    vec3 toward_eye = normalize(eye.xyz - eye.w * v_world);
    vec3 normal = normalize(gl_FrontFacing ? v_normal : -v_normal);
    // A smooth normal may lean behind the horizon of a face that is still seen: bring it up to the horizon.
    float facing = dot(normal, toward_eye);
    if (facing < 0.0) normal = normalize(normal - facing * toward_eye);
    vec3 albedo = surface_albedo(v_uv, v_tint.rgb);
    if (output_kind == 1) return vec4(srgb_from_linear(albedo), 1.0);
    if (output_kind == 2) return vec4(view_from_world * normal * 0.5 + 0.5, 1.0);
    vec3 diffuse, specular;
    shade(normal, toward_eye, gloss, diffuse, specular);
    return vec4(srgb_from_linear(albedo * diffuse + specular), 1.0);
}
