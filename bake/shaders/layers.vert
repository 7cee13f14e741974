#version 330
// HAS_TEXTURE and HAS_COLOR are defined where the primitive has texture coordinates to use, or vertex colours.

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
#ifdef HAS_TEXTURE
layout(location = 2) in vec2 uv;
out vec2 texture_uv;
#endif
#ifdef HAS_COLOR
layout(location = 3) in vec4 color;
out vec4 vertex_color; // linear
#endif

uniform mat4 V;               // view from model
uniform mat4 P;               // clip from view
uniform vec2 depth_transform; // depth = z along back * x + y

out vec4 normal_depth; // view space; one vector, as every varying costs the rasteriser a plane equation

void main() {
    vec4 in_view = V * vec4(position, 1.0);
    gl_Position = P * in_view;
    normal_depth = vec4(mat3(V) * normal, in_view.z * depth_transform.x + depth_transform.y);
#ifdef HAS_TEXTURE
    texture_uv = uv;
#endif
#ifdef HAS_COLOR
    vertex_color = color;
#endif
}
