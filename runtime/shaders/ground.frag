#version 330
// A plane, textured or plain, that fades into the background.
#include "srgb.glsl"
#include "lights.glsl"
uniform sampler2D base_texture;
uniform vec3 normal;
uniform vec3 albedo;
uniform float tile;         // metres that the texture spans
uniform vec2 fade;          // metres from the middle where it starts and where nothing is left
uniform vec4 background;    // sRGB curve, premultiplied
in vec2 v_metres;
out vec4 color;

void main() {
    vec3 diffuse, specular;
    shade(normal, normal, vec2(0.0, 1.0), diffuse, specular);
    vec3 surface = texture(base_texture, v_metres / tile).rgb * albedo;
    float left = 1.0 - smoothstep(fade.x, fade.y, length(v_metres));
    color = mix(background, vec4(srgb_from_linear(surface * diffuse), 1.0), left);
}
