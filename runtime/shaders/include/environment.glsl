// Light from all around. Equals impostor.environment.cube.sample of an environment's levels and of its diffuse light.
uniform sampler2D environments;  // as runtime.rooms.environments lays them out
const float DIFFUSE_SIZE = 32.0;

// Column and row on a face, -1 to 1, and the face's number.
vec3 on_face(vec3 toward) {
    vec3 sizes = abs(toward);
    bool on_x = sizes.x >= sizes.y && sizes.x >= sizes.z, on_y = !on_x && sizes.y >= sizes.z;
    float longest = on_x ? toward.x : on_y ? toward.y : toward.z;
    float side = longest < 0.0 ? -1.0 : 1.0;
    vec2 place = vec2(on_x ? -side * toward.z : on_y ? toward.x : side * toward.x, on_y ? side * toward.z : -toward.y);
    return vec3(place / abs(longest), (on_x ? 0.0 : on_y ? 2.0 : 4.0) + (side < 0.0 ? 1.0 : 0.0));
}

// Of six faces: the middle of the first, half its size, and how far apart they are; parts of the texture's size.
vec3 texel_of(mat3x2 faces, vec3 place) {
    float row = place.z > 2.5 ? 1.0 : 0.0;
    return textureLod(environments, faces[0] + faces[1] * place.xy + faces[2] * vec2(place.z - 3.0 * row, row), 0.0).rgb;
}

vec3 face_texel(vec2 origin, float size, vec3 place) {
    vec2 texel = 1.0 / vec2(textureSize(environments, 0));
    return texel_of(mat3x2(texel * (origin + 0.5 * size + 1.0), texel * 0.5 * size, texel * (size + 2.0)), place);
}

// How far apart on the cube, whose half side is 1, neighbouring pixels look. Outside of branches only.
float footprint_of(vec3 toward) {
    vec3 sizes = abs(toward);
    vec3 met = toward / max(max(sizes.x, sizes.y), max(sizes.z, 1e-30));
    vec3 right = dFdx(met), up = dFdy(met);
    return sqrt(max(dot(right, right), dot(up, up)));
}

// Equals runtime.rooms.environments.level_origin; `prefiltered` is 1 for the levels of roughness.
vec2 level_origin(float size, float level, float level_size, float prefiltered) {
    vec2 first = vec2(0.0, 2.0 * size + 4.0), others = vec2(12.0 * (0.25 * size - level_size + level - 2.0), 3.0 * size + 8.0);
    vec2 origin = level < 0.5 ? vec2(0.0) : level < 1.5 ? first : others;
    return origin + vec2(prefiltered * 3.0 * (level_size + 2.0), 0.0);
}

vec3 level_texel(vec4 environment, float level, float prefiltered, vec3 place) {
    float size = environment.z * exp2(-level);
    return face_texel(environment.xy + level_origin(environment.z, level, size, prefiltered), size, place);
}

// The light around a direction; `environment`: corner, size of level 0 and number of the last level. A footprint of 0
// is Environment.mirrored; a larger one, as footprint_of gives, keeps a mirror that is far away from flickering.
vec3 light_around(vec4 environment, vec3 toward, float roughness, float footprint) {
    vec3 place = on_face(toward);
    float last = environment.w;
    bool sharp = roughness * last < 1.0;
    // A sharp reflection reads halved faces, a rough one the lobes, whose next is as wide as the footprint.
    float minified = clamp(log2(max(footprint * 0.5 * environment.z, 1.0)), 0.0, last);
    float lobe = clamp(max(roughness, 0.5 * sqrt(footprint)), 0.0, 1.0) * last;
    float level = sharp ? minified : max(lobe, 1.0), below = min(floor(level), max(last - 1.0, 0.0));
    float wide = sharp ? 0.0 : 1.0;
    vec3 finer = level_texel(environment, below, wide, place), coarser = level_texel(environment, min(below + 1.0, last), wide, place);
    vec3 light = mix(finer, coarser, level - below);
    if (sharp && roughness > 0.0 && last > 0.0)
        light = mix(light, level_texel(environment, 1.0, 1.0, place), roughness * last);
    return light;
}

vec3 diffuse_light_around(vec4 environment, vec3 normal) {
    // Behind the last level, and in the third row also where there are fewer levels than rows.
    float level = max(environment.w + 1.0, 2.0);
    vec2 origin = level_origin(environment.z, level, environment.z * exp2(-level), 0.0);
    return face_texel(environment.xy + origin, DIFFUSE_SIZE, on_face(normal));
}
