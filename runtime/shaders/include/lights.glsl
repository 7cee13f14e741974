// Directional lights and a Blinn-Phong highlight. Equals impostor.lighting.colormap, one normal at a time.
uniform sampler2D lights;  // column 0: direction toward the light; column 1: linear colour; one row a light
uniform int light_count;
uniform vec3 ambient;

void shade(vec3 normal, vec3 toward_eye, vec2 gloss, out vec3 diffuse, out vec3 specular) {
    diffuse = ambient;
    specular = vec3(0.0);
    for (int i = 0; i < light_count; ++i) {
        vec3 toward = texelFetch(lights, ivec2(0, i), 0).xyz;
        float facing = dot(normal, toward);
        if (facing > 0.0) {
            vec3 color = texelFetch(lights, ivec2(1, i), 0).rgb;
            diffuse += color * facing;
            if (gloss.x > 0.0) {
                float along = max(dot(normal, normalize(toward + toward_eye)), 0.0);
                specular += color * gloss.x * pow(along, gloss.y);
            }
        }
    }
}
