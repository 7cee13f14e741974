// Directional lights and a Blinn-Phong highlight. Equals impostor.lighting.colormap, one normal at a time.
uniform sampler2D lights;  // column 0: direction toward the light; column 1: linear colour; one row a light
uniform int light_count;
uniform vec3 ambient;

vec3 diffuse_of_lights(vec3 normal) {
    vec3 diffuse = ambient;
    for (int i = 0; i < light_count; ++i)
        diffuse += texelFetch(lights, ivec2(1, i), 0).rgb * max(dot(normal, texelFetch(lights, ivec2(0, i), 0).xyz), 0.0);
    return diffuse;
}

vec3 highlights_of_lights(vec3 normal, vec3 toward_eye, vec2 gloss) {
    vec3 specular = vec3(0.0);
    // A loop that a matt surface never enters: a software rasteriser also runs what an `if` leaves out.
    int highlights = gloss.x > 0.0 ? light_count : 0;
    for (int i = 0; i < highlights; ++i) {
        vec3 toward = texelFetch(lights, ivec2(0, i), 0).xyz;
        float along = max(dot(normal, normalize(toward + toward_eye)), 0.0);
        if (dot(normal, toward) > 0.0) specular += texelFetch(lights, ivec2(1, i), 0).rgb * gloss.x * pow(along, gloss.y);
    }
    return specular;
}

void shade(vec3 normal, vec3 toward_eye, vec2 gloss, out vec3 diffuse, out vec3 specular) {
    diffuse = diffuse_of_lights(normal);
    specular = highlights_of_lights(normal, toward_eye, gloss);
}
