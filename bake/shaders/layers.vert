#version 330
// HAS_TEXTURE, HAS_COLOR and HAS_NORMAL_MAP are defined where the primitive has texture coordinates to use, vertex
// colours, or coordinates and tangents for a normal map.

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

#ifdef HAS_NORMAL_MAP
layout(location = 4) in vec2 normal_uv;
layout(location = 5) in vec4 tangent; // w: -1 where the picture is mirrored
out vec2 map_uv;
out vec3 map_tangent; // view space
flat out float map_side;
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
#ifdef HAS_NORMAL_MAP
    map_uv = normal_uv;
    map_tangent = mat3(V) * tangent.xyz;
    map_side = tangent.w;
#endif
}
