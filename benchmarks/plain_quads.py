"""The floor for the impostor pass: the same quads with one plain texture fetch a pixel."""

from __future__ import annotations

import moderngl

from benchmarks.scenes import BACKGROUND, Field
from runtime.fans.impostor_pass import ALPHA_CUTOFF
from runtime.fans.quad_records import QUAD_DTYPE
from runtime.gl.programs import set_uniforms
from runtime.gl.uploads import CORNERS

VERTEX = """
#version 330
uniform mat4 clip_from_world;
uniform vec2 texture_size;
in vec2 corner;
in vec3 center, right, up;
in vec4 rectangle;
in vec3 place;
out vec2 v_uv;
void main() {
    vec2 plane = mix(rectangle.xy, rectangle.zw, corner);
    gl_Position = clip_from_world * vec4(center + plane.x * right + plane.y * up, 1.0);
    v_uv = (place.xy + (vec2(plane.x, -plane.y) * 0.5 + 0.5) * place.z) / texture_size;
}
"""
FRAGMENT = """
#version 330
uniform sampler2D picture;
uniform float alpha_cutoff;
in vec2 v_uv;
out vec4 color;
void main() {
    color = FETCH;
    if (color.a < alpha_cutoff) discard;
}
"""
BILINEAR, TRILINEAR = "textureLod(picture, v_uv, 0.0)", "texture(picture, v_uv)"


class PlainQuads:
    """Draws the quads of a field's last frame from a copy of its relit tiles, at the quads' own depth.

    The records come from the impostor pass itself, so the rectangles and their order are the same.

    Parameters
    ----------
    field : Field
        After a frame of impostors.
    """

    def __init__(self, field: Field):
        ctx, impostors = field.ctx, field.renderer._impostors
        cache = impostors._cache
        assert cache is not None
        self._field, self._ctx = field, ctx
        self._count = impostors._whole.count
        self._records = ctx.buffer(impostors._whole.quads.buffer.read(self._count * QUAD_DTYPE.itemsize))
        self._corners = ctx.buffer(CORNERS)
        self._texture = ctx.texture(cache.color.size, 4, cache.color.read())
        self._arrays = {fetch: self._array(fetch) for fetch in (BILINEAR, TRILINEAR)}

    def _array(self, fetch: str) -> moderngl.VertexArray:
        program = self._ctx.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT.replace("FETCH", fetch))
        clip_from_world, size = self._field.viewer.clip_from_world, self._texture.size
        set_uniforms(program, clip_from_world=clip_from_world, texture_size=size, alpha_cutoff=ALPHA_CUTOFF)
        layout = "3f 3f 3f 12x 4f 3f 16x/i"
        names = ("center", "right", "up", "rectangle", "place")
        return self._ctx.vertex_array(program, [(self._corners, "2f", "corner"), (self._records, layout, *names)])

    def prepare(self, fetch: str) -> None:
        """Set the filter that a fetch needs, before the clock starts."""
        if fetch == TRILINEAR:
            self._texture.build_mipmaps()
            self._texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        else:
            self._texture.filter = (moderngl.LINEAR, moderngl.LINEAR)

    def draw(self, fetch: str) -> None:
        """A frame of plain quads: one draw call, blended, depth tested and written by the rasteriser."""
        self._field.target.clear(BACKGROUND)
        self._ctx.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND)
        self._ctx.depth_func = "<"
        self._ctx.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        self._texture.use(0)
        self._arrays[fetch].render(moderngl.TRIANGLE_STRIP, instances=self._count)
        self._ctx.enable_only(moderngl.NOTHING)

    def release(self) -> None:
        """Free everything on the GPU."""
        for array in self._arrays.values():
            program = array.program
            array.release()
            program.release()
        for resource in (self._texture, self._records, self._corners):
            resource.release()
