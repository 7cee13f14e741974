// The ground in its own light and that of lights; it fades into the background.
uniform sampler2D base_texture;
uniform vec3 normal;
uniform vec3 albedo;
uniform float tile;         // metres that the texture spans
uniform vec2 fade;          // metres from the middle where it starts and where nothing is left
uniform vec4 background;    // sRGB curve, premultiplied
in vec3 v_world;
in vec2 v_metres;
out vec4 color;

vec4 ground_color(vec3 light_of_rooms) {
    vec3 diffuse, specular;
    shade(normal, normal, vec2(0.0, 1.0), diffuse, specular);
    vec3 surface = texture(base_texture, v_metres / tile).rgb * albedo;
    float left = 1.0 - smoothstep(fade.x, fade.y, length(v_metres));
    return mix(background, vec4(srgb_from_linear(surface * (diffuse + light_of_rooms)), 1.0), left);
}
