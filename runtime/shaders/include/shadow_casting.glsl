// Along a light onto the ground. Equals impostor.shadow_projection.along_light.
vec3 on_ground(vec3 world, vec4 ground, vec3 toward_light) {
    return world - dot(ground, vec4(world, 1.0)) / dot(ground.xyz, toward_light) * toward_light;
}

// Below 0 what is buried, and casts nothing; what may be under the ground by rounding only is not.
float out_of_ground(vec3 world, vec4 ground) {
    vec4 point = vec4(world, 1.0);
    return dot(ground, point) + 1e-6 * dot(abs(ground), abs(point));
}

vec3 placed(vec3 point, vec4 position_scale, vec2 turn) {
    vec3 turned = vec3(turn.x * point.x + turn.y * point.z, point.y, turn.x * point.z - turn.y * point.x);
    return position_scale.xyz + position_scale.w * turned;
}

// How far the shadow of a point so high over the ground has left the place that the feet's has for the true one.
// Equals impostor.shadow_projection.above_feet.
uniform float feet;  // metres, of a copy of scale 1

float above_feet(float height, float scale) {
    return smoothstep(0.0, feet * scale, height);
}
