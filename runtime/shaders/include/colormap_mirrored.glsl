// What a fan mirrors. Equals Environment.mirrored: two levels and the way between them.
uniform mat3x2 finer, coarser;
uniform float between;

vec3 light_toward(vec3 toward) {
    vec3 place = on_face(toward);
    return mix(texel_of(finer, place), texel_of(coarser, place), between);
}
