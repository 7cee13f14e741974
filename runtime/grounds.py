"""The ground pass: a lit plane for shadows to fall on."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.shadow_projection import Ground
from runtime.gl_state import CallerState, set_state
from runtime.gpu import SRGB8_ALPHA8, check_texture_size, load_program, set_uniforms
from runtime.instances import Viewer
from runtime.lights import LightTable


@dataclass(frozen=True, eq=False)
class GroundSurface:
    """What the ground looks like.

    Parameters
    ----------
    albedo : tuple of float
        Linear; multiplies the texture.
    texture : ndarray, (H, W, 4) uint8, optional
        sRGB; repeats every `tile` metres.
    tile : float
        Metres.
    middle : tuple of float
        World space; the ground fades out with the distance from here.
    reach : float
        Metres to where it is gone; it starts to fade at half of that.
    background : tuple of float
        What it fades into: sRGB curve, premultiplied. Without alpha, as it is, that is what was drawn before.
    """

    albedo: tuple[float, float, float] = (0.5, 0.5, 0.5)
    texture: NDArray[np.uint8] | None = None
    tile: float = 1.0
    middle: tuple[float, float, float] = (0.0, 0.0, 0.0)
    reach: float = 100.0
    background: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)


class GroundPass:
    """Draws a ground plane in the caller's framebuffer.

    Parameters
    ----------
    ctx : moderngl.Context
    """

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self._program = load_program(ctx, "ground.vert", "ground.frag")
        self._corners = ctx.buffer(reserve=4 * 5 * 4, dynamic=True)
        self._array = ctx.vertex_array(self._program, [(self._corners, "3f 2f", "corner", "metres")])
        self._white = ctx.texture((1, 1), 4, b"\xff\xff\xff\xff")
        self._textures: dict[int, tuple[NDArray[np.uint8], moderngl.Texture]] = {}

    def draw(
        self, state: CallerState, viewer: Viewer, lights: LightTable, ground: Ground, surface: GroundSurface
    ) -> None:
        """Draw the plane, depth-tested, from either side."""
        axis = np.eye(3)[2] if abs(ground.normal[2]) < 0.9 else np.eye(3)[0]
        right = np.cross(ground.normal, axis)
        axes = np.stack([right / np.linalg.norm(right), np.cross(ground.normal, right / np.linalg.norm(right))])
        middle = np.array(surface.middle) - (ground.normal @ surface.middle - ground.offset) * ground.normal
        metres = surface.reach * np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]], float)
        self._corners.write(np.hstack([metres @ axes + middle, metres]).astype("f4").tobytes())
        state.bind_target()
        set_state(depth_test=True, depth_write=True, blend=(moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA))
        self._texture(surface).use(0)
        lights.bind(self._program, unit=1)
        set_uniforms(
            self._program,
            clip_from_world=viewer.clip_from_world,
            base_texture=0,
            normal=tuple(ground.normal),
            albedo=surface.albedo,
            tile=surface.tile,
            fade=(surface.reach / 2, surface.reach),
            background=surface.background,
        )
        self._array.render(moderngl.TRIANGLE_STRIP)

    def _texture(self, surface: GroundSurface) -> moderngl.Texture:
        pixels = surface.texture
        if pixels is None:
            return self._white
        if id(pixels) not in self._textures:
            height, width = pixels.shape[:2]
            check_texture_size(self._ctx, "ground texture", width, height)
            texture = self._ctx.texture((width, height), 4, pixels.tobytes(), internal_format=SRGB8_ALPHA8)
            texture.build_mipmaps()
            texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
            self._textures[id(pixels)] = (pixels, texture)
        return self._textures[id(pixels)][1]

    def release(self) -> None:
        """Free everything this pass made."""
        for resource in (self._array, self._corners, self._white, self._program):
            resource.release()
        for _, texture in self._textures.values():
            texture.release()
        self._textures.clear()
