// The light of a flat surface: a sum of pictures. Equals impostor.ptm.shading.shaded.
const int MOST_TERMS = 48;
uniform int term_count;
uniform vec4 terms[3 * MOST_TERMS];  // weights of a0..a3; of a4, a5; linear colour

vec3 sum_of_terms() {
    vec3 sum = vec3(0.0);
    for (int i = 0; i < term_count; ++i)
        sum += terms[3 * i + 2].rgb * light_of(ptm_value(terms[3 * i], terms[3 * i + 1].xy));
    return sum;
}
