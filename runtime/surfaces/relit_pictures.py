"""Flat surfaces under lights that stand still: the PTM evaluated once, into a picture that costs one plain fetch."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from runtime.gl.programs import load_program, set_uniforms
from runtime.gl.state import draw_into_level, set_state
from runtime.gl.uploads import CORNERS
from runtime.surfaces.textures import KINDS, PtmTextures

MOST_TERMS = 48  # pictures that make up a flat surface's light, as the shader's array has it
# Relighting a PTM costs several frames of it lit pixel by pixel: it has to be drawn this often under the same lights
# first. Lights that move in every frame are not worth a picture, also where a frame has several viewers.
PATIENCE = 4
MOST_TEXELS = 1 << 26  # of all pictures; the rest is lit pixel by pixel


Key = tuple[int, bytes]


class RelitPicture:
    """A PTM's picture on the sRGB curve, with mip levels."""

    def __init__(self, ctx: moderngl.Context, ptm: PtmTextures):
        self.ptm = ptm.ptm  # held, so that no other can take its identity
        self.texture = ctx.texture(ptm.size, 4)
        # Mip levels allotted after the framebuffer is made leave it drawing into the texture's old storage.
        self.texture.build_mipmaps()
        self.texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self.texture.anisotropy = ptm.anisotropy
        self.target = ctx.framebuffer([self.texture])

    def use_level(self, level: int) -> None:
        """Bind the framebuffer, to draw into one mip level."""
        width, height = (max(side >> level, 1) for side in self.texture.size)
        self.target.viewport = (0, 0, width, height)
        self.target.use()
        draw_into_level(self.texture, level)

    @property
    def texels(self) -> int:
        """How many it has at its finest level."""
        return self.texture.width * self.texture.height

    def release(self) -> None:
        """Free the texture."""
        self.target.release()
        self.texture.release()


@dataclass
class _Shown:
    """The picture that a surface wants, and how many draws it has wanted it for."""

    key: Key
    draws: int = 0


class RelitPictures:
    """The pictures of all flat surfaces; those with the same PTM, turn and lights share one.

    Parameters
    ----------
    ctx : moderngl.Context

    Attributes
    ----------
    made : int
        Pictures that the last update made.
    """

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self._corners = ctx.buffer(CORNERS)
        self._arrays = {
            kind: ctx.vertex_array(
                load_program(ctx, "ptm_relight.vert", f"ptm_relight_{kind}.frag"), [(self._corners, "2f", "corner")]
            )
            for kind in KINDS
        }
        self._shown: dict[int, _Shown] = {}
        self._pictures: dict[Key, RelitPicture] = {}
        self.made = 0

    def keep(self, surfaces: Set[int]) -> None:
        """Forget all surfaces but these, by their identity."""
        self._shown = {surface: shown for surface, shown in self._shown.items() if surface in surfaces}
        self._free_all_but({shown.key for shown in self._shown.values()})

    def update(self, wanted: Mapping[int, tuple[PtmTextures, NDArray[np.float32]]]) -> dict[int, RelitPicture]:
        """Pictures for the surfaces of a draw; changes the bound framebuffer.

        Parameters
        ----------
        wanted : mapping of int to (PtmTextures, ndarray)
            A flat surface's identity to its PTM and its light, as `packed_terms` gives it.

        Returns
        -------
        dict of int to RelitPicture
            Without the surfaces that have to be lit pixel by pixel.
        """
        keys = {surface: (id(ptm.ptm), terms.tobytes()) for surface, (ptm, terms) in wanted.items()}
        for surface, key in keys.items():
            if surface not in self._shown or self._shown[surface].key != key:
                self._shown[surface] = _Shown(key)
            self._shown[surface].draws += 1
        self._free_all_but({shown.key for shown in self._shown.values()})
        self.made = 0
        for surface, (ptm, terms) in wanted.items():
            key = keys[surface]
            if key not in self._pictures and self._shown[surface].draws > PATIENCE and self._has_room(ptm, keys):
                self._pictures[key] = self._relight(ptm, terms)
                self.made += 1
        return {surface: self._pictures[key] for surface, key in keys.items() if key in self._pictures}

    def _has_room(self, ptm: PtmTextures, keys: Mapping[int, Key]) -> bool:
        """Whether one more picture fits, if need be in place of those that are not drawn now."""
        new = ptm.size[0] * ptm.size[1]
        if new + sum(picture.texels for picture in self._pictures.values()) > MOST_TEXELS:
            self._free_all_but(set(keys.values()))
        return new + sum(picture.texels for picture in self._pictures.values()) <= MOST_TEXELS

    def _relight(self, ptm: PtmTextures, terms: NDArray[np.float32]) -> RelitPicture:
        picture, array = RelitPicture(self._ctx, ptm), self._arrays[ptm.kind]
        ptm.bind(array.program, repeat=False)
        bind_terms(array.program, terms)
        # Each level from the coefficients' own: it shows what would be seen without a picture.
        for level in range(max(ptm.size).bit_length()):
            picture.use_level(level)
            set_state()
            set_uniforms(array.program, level=level)
            array.render(moderngl.TRIANGLE_STRIP)
        return picture

    def _free_all_but(self, keys: Set[Key]) -> None:
        for key in self._pictures.keys() - keys:
            self._pictures.pop(key).release()

    def release(self) -> None:
        """Free everything on the GPU."""
        self.keep(set())
        for array in self._arrays.values():
            program = array.program
            array.release()
            program.release()
        self._arrays.clear()
        self._corners.release()


def packed_terms(weights: NDArray[np.float64], colors: NDArray[np.float64]) -> NDArray[np.float32]:
    """What `flat_terms` gives, as `ptm_terms.glsl` reads it, (N, 12)."""
    packed = np.zeros((len(weights), 12), np.float32)
    packed[:, :6], packed[:, 8:11] = weights, colors
    return packed


def bind_terms(program: moderngl.Program, terms: NDArray[np.float32]) -> None:
    """Give a program that includes `ptm_terms.glsl` its uniforms."""
    padded = np.zeros((MOST_TERMS, 12), np.float32)
    padded[: len(terms)] = terms
    set_uniforms(program, terms=padded.ravel(), term_count=len(terms))
