// Along a light onto the ground; what is buried goes to the place above it. Equals
// impostor.shadow_projection.along_light.
vec3 on_ground(vec3 world, vec4 ground, vec3 toward_light) {
    float height = dot(ground, vec4(world, 1.0));
    vec3 slope = toward_light / dot(ground.xyz, toward_light);
    return world - max(height, 0.0) * slope - min(height, 0.0) * ground.xyz;
}

vec3 placed(vec3 point, vec4 position_scale, vec2 turn) {
    vec3 turned = vec3(turn.x * point.x + turn.y * point.z, point.y, turn.x * point.z - turn.y * point.x);
    return position_scale.xyz + position_scale.w * turned;
}
