"""The ceiling for the bake: the same multi-target geometry pass in bare moderngl, nothing around it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import moderngl
import numpy as np

import bake
from bake.resolve import CapturedView
from bake.vertices import vertex_records
from impostor.model import Model, Primitive
from impostor.views import View

SHADERS = Path(bake.__file__).parent / "shaders"
SRGB8_ALPHA8 = 0x8C43


class RawPass:
    """One framebuffer, one vertex array a primitive, one draw call each.

    It shares the shaders and vertex records with `bake.capture.Capture`, and nothing else: the time of one against
    the other is what pyrender costs, and their pixels must be equal.

    Parameters
    ----------
    model : Model
    size : int
        Side of a tile in texels.
    samples : int
        Samples along a texel's side.
    """

    def __init__(self, model: Model, size: int, samples: int):
        self.side = size * samples
        headless: Any = {"backend": "egl"}
        self._ctx = moderngl.create_context(require=330, standalone=True, **headless)
        self._origin = model.bounds.mean(axis=0)
        with self._ctx:
            shape = (self.side, self.side)
            targets = [self._ctx.renderbuffer(shape), self._ctx.renderbuffer(shape, dtype="nu2")]
            self._framebuffer = self._ctx.framebuffer(targets, self._ctx.depth_renderbuffer(shape))
            self._draws = [self._draw(primitive) for primitive in model.primitives]

    def view(self, view: View) -> CapturedView:
        """Every layer of one view: what `Capture.view` gives."""
        view_from_model = np.eye(4)
        view_from_model[:3, :3] = view.basis
        view_from_model[:3, 3] = view.basis @ (self._origin - view.center)
        clip_from_view = view.clip_from_model() @ np.block([[view.basis.T, view.center[:, None]], [np.eye(4)[3:]]])
        low, high = view.depth_range
        with self._ctx:
            self._framebuffer.use()
            self._framebuffer.clear()
            self._ctx.enable(moderngl.DEPTH_TEST)
            for program, vertex_array, textures, double_sided in self._draws:
                program["V"].write(view_from_model.T.astype("f4").tobytes())
                program["P"].write(clip_from_view.T.astype("f4").tobytes())
                program["depth_transform"] = 1 / (high - low), -low / (high - low)
                for unit, texture in enumerate(textures):
                    texture.use(unit)
                (self._ctx.disable if double_sided else self._ctx.enable)(moderngl.CULL_FACE)
                vertex_array.render()
            return CapturedView(view, self._read(0, "f1", np.uint8), self._read(1, "nu2", np.uint16))

    def release(self):
        """Give back the context."""
        self._ctx.release()

    def _read(self, attachment: int, kind: str, dtype: Any) -> Any:
        pixels = np.empty((self.side, self.side, 4), dtype)
        self._framebuffer.read_into(pixels, components=4, attachment=attachment, dtype=kind)
        return pixels[::-1]

    def _draw(self, primitive: Primitive) -> tuple[Any, moderngl.VertexArray, list[moderngl.Texture], bool]:
        material, pictures = primitive.material, {}
        vertices, triangles = vertex_records(primitive, self._origin)
        names = list(vertices.dtype.names or ())
        defines = ["HAS_COLOR"] if "color" in names else []
        if "uv" in names:
            defines.append("HAS_TEXTURE")
            pictures["base_texture"] = self._texture(material.texture)
        if "tangent" in names and material.normal_map is not None:
            defines.append("HAS_NORMAL_MAP")
            pictures["normal_map"] = self._texture(material.normal_map.picture)
        if material.alpha_mode != "OPAQUE":
            defines.append(f"ALPHA_{material.alpha_mode}")
        program = self._ctx.program(_source("layers.vert", defines), _source("layers.frag", defines))
        program["base_color"] = tuple(material.base_color)
        if material.alpha_mode == "MASK":
            program["alpha_cutoff"] = material.alpha_cutoff
        if material.normal_map is not None and "normal_map" in pictures:
            program["normal_scale"] = material.normal_map.scale
        for unit, name in enumerate(pictures):
            program[name] = unit
        formats = {"position": "3f", "normal": "3f", "uv": "2f", "color": "4f2", "normal_uv": "2f", "tangent": "4f"}
        layout = (self._ctx.buffer(vertices), " ".join(formats[name] for name in names), *names)
        vertex_array = self._ctx.vertex_array(program, [layout], self._ctx.buffer(triangles))
        return program, vertex_array, list(pictures.values()), material.double_sided

    def _texture(self, pixels: Any) -> moderngl.Texture:
        height, width, channels = pixels.shape
        kind: Any = {"internal_format": SRGB8_ALPHA8} if channels == 4 else {"alignment": 1}
        texture = self._ctx.texture((width, height), channels, np.ascontiguousarray(pixels), **kind)
        texture.build_mipmaps()
        return texture


def _source(name: str, defines: list[str]) -> str:
    text = (SHADERS / name).read_text(encoding="utf-8")
    return text.replace("#version 330\n", "#version 330\n" + "".join(f"#define {define}\n" for define in defines), 1)
