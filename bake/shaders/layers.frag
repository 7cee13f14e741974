#version 330
// One sample of every layer. ALPHA_MASK or ALPHA_BLEND is defined where the material is one of these.

in vec4 normal_depth;
#ifdef HAS_TEXTURE
in vec2 texture_uv;
uniform sampler2D base_texture;
#endif
#ifdef HAS_COLOR
in vec4 vertex_color;
#endif
#ifdef HAS_NORMAL_MAP
in vec2 map_uv;
in vec3 map_tangent;
flat in float map_side; // -1 where the picture is mirrored
uniform sampler2D normal_map;
uniform float normal_scale;
#endif

uniform vec4 base_color; // linear
#ifdef ALPHA_MASK
uniform float alpha_cutoff;
#endif

layout(location = 0) out vec4 color_sample;   // albedo, sRGB; alpha 1
layout(location = 1) out vec4 surface_sample; // normal / 2 + 1/2, depth

vec3 srgb_from_linear(vec3 linear) {
    return mix(12.92 * linear, 1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, linear));
}

// A normal that interpolation turned away from the camera is bent back to the silhouette.
vec3 toward_camera(vec3 normal) {
    normal = normalize(normal);
    normal.z = max(normal.z, 0.0);
    float square = dot(normal, normal);
    return square > 1e-6 ? normal * inversesqrt(square) : vec3(0.0, 0.0, 1.0);
}

#ifdef HAS_NORMAL_MAP
// As `impostor.normal_map.mapped_normals`.
vec3 mapped(vec3 normal) {
    vec3 up = normalize(normal), right = map_tangent / max(length(map_tangent), 1e-6);
    vec3 lean = (texture(normal_map, map_uv).rgb - 128.0 / 255.0) * (255.0 / 127.0) * vec3(normal_scale, normal_scale, 1.0);
    return lean.x * right + lean.y * map_side * cross(up, right) + max(lean.z, 0.01) * up;
}
#endif

#ifdef ALPHA_BLEND
// The ordered dither of Bayer, 16 x 16: every aligned block of 4 x 4 samples holds 16 evenly spaced thresholds.
float bayer_threshold(uvec2 pixel) {
    uint rank = 0u;
    for (int bit = 0; bit < 4; ++bit) {
        uvec2 parity = (pixel >> bit) & 1u;
        rank = rank * 4u + (parity.x ^ parity.y) * 2u + parity.y;
    }
    return (float(rank) + 0.5) / 256.0;
}
#endif

void main() {
    vec4 albedo = base_color;
#ifdef HAS_TEXTURE
    albedo *= texture(base_texture, texture_uv);
#endif
#ifdef HAS_COLOR
    albedo *= vertex_color;
#endif

#if defined(ALPHA_MASK) || defined(ALPHA_BLEND)
    float alpha = base_color.a;
#ifdef HAS_TEXTURE
    // Mip-maps average a cut-out away, so its edge is that of the full picture.
    alpha *= textureLod(base_texture, texture_uv, 0.0).a;
#endif
#ifdef HAS_COLOR
    alpha *= vertex_color.a;
#endif
#endif
#ifdef ALPHA_MASK
    if (alpha < alpha_cutoff) discard;
#endif
#ifdef ALPHA_BLEND
    if (alpha <= bayer_threshold(uvec2(gl_FragCoord.xy))) discard;
#endif

    vec3 normal = normal_depth.xyz;
#ifdef HAS_NORMAL_MAP
    normal = mapped(normal);
#endif
    if (!gl_FrontFacing) normal = -normal;
    color_sample = vec4(srgb_from_linear(albedo.rgb), 1.0);
    surface_sample = vec4(toward_camera(normal) * 0.5 + 0.5, normal_depth.w);
}
