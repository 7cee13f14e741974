"""The ground pass: a lit plane for shadows to fall on."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.errors import SettingsError
from impostor.shadow_projection import Ground
from runtime.checks import LARGEST, bounded, check_number, check_type
from runtime.gl.programs import load_program, set_uniforms
from runtime.gl.state import CallerState, set_state
from runtime.gl.uploads import SRGB8_ALPHA8, check_texture_size
from runtime.ground.ground_light import room_diffuse
from runtime.lights.light_table import LightTable
from runtime.rooms.environments import RoomTable
from runtime.viewing.viewer import Viewer


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

    Raises
    ------
    SettingsError
        Numbers of another count, not finite or below 0; a tile or a reach that is not above 0; another texture.
    """

    albedo: tuple[float, float, float] = (0.5, 0.5, 0.5)
    texture: NDArray[np.uint8] | None = None
    tile: float = 1.0
    middle: tuple[float, float, float] = (0.0, 0.0, 0.0)
    reach: float = 100.0
    background: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    def __post_init__(self):
        for name, count in (("albedo", 3), ("middle", 3), ("background", 4)):
            given = bounded("ground surface", name, getattr(self, name), (count,))
            if name != "middle" and given.min() < 0:
                raise SettingsError("ground surface", f"{name} goes down to {given.min():g}; expected at least 0")
        for name in ("tile", "reach"):
            check_number("ground surface", name, getattr(self, name), 0, LARGEST, above=True)
        texture = self.texture
        if texture is None:
            return
        check_type("ground texture", texture, np.ndarray)
        if texture.dtype != np.uint8 or texture.ndim != 3 or texture.shape[2] != 4 or not texture.size:
            raise SettingsError("ground texture", f"{texture.shape} {texture.dtype}; expected (H, W, 4) uint8")

    @property
    def fade(self) -> tuple[float, float]:
        """Metres from the middle where it starts to fade and where nothing is left."""
        return self.reach / 2, self.reach


class GroundPass:
    """Draws a ground plane in the caller's framebuffer.

    Parameters
    ----------
    ctx : moderngl.Context
    """

    memory_kind = "ground"

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self._corners = ctx.buffer(reserve=4 * 5 * 4, dynamic=True)
        self._programs = [load_program(ctx, "ground.vert", name) for name in ("ground.frag", "ground_rooms.frag")]
        layout = [(self._corners, "3f 2f", "corner", "metres")]
        self._alike, self._in_rooms = (ctx.vertex_array(program, layout) for program in self._programs)
        self._white = ctx.texture((1, 1), 4, b"\xff\xff\xff\xff")
        self._textures: dict[int, tuple[NDArray[np.uint8], moderngl.Texture]] = {}

    def draw(
        self,
        state: CallerState,
        viewer: Viewer,
        lights: LightTable,
        rooms: RoomTable,
        ground: Ground,
        surface: GroundSurface,
    ) -> None:
        """Draw the plane, depth-tested, from either side; among several rooms each pixel in its own light."""
        axes, middle = _axes(ground), _middle(ground, surface)
        metres = surface.reach * np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]], float)
        self._corners.write(np.hstack([metres @ axes + middle, metres]).astype("f4").tobytes())
        state.bind_target()
        set_state(depth_test=True, depth_write=True, blend=(moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA))
        self._texture(surface).use(0)
        array = self._alike if len(lights.rooms) < 2 else self._in_rooms
        if array is self._alike:
            light = room_diffuse(lights.rooms[0], ground.normal) if lights.rooms else np.zeros(3)
            set_uniforms(array.program, light_of_room=light)
        else:
            rooms.bind(array.program, unit=2)
        lights.bind(array.program, unit=1)
        set_uniforms(
            array.program,
            clip_from_world=viewer.clip_from_world,
            base_texture=0,
            normal=tuple(ground.normal),
            albedo=surface.albedo,
            tile=surface.tile,
            fade=surface.fade,
            background=surface.background,
        )
        array.render(moderngl.TRIANGLE_STRIP)

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
        for resource in (self._alike, self._in_rooms, self._corners, self._white, *self._programs):
            resource.release()
        for _, texture in self._textures.values():
            texture.release()
        self._textures.clear()


def metres_from_screen(viewer: Viewer, ground: Ground, surface: GroundSurface) -> NDArray[np.float64]:
    """(3, 3) float64: from (x, y, 1) in clip space to homogeneous metres on the ground from the surface's middle."""
    world_from_clip = np.linalg.inv(viewer.clip_from_world)
    plane = ground.plane @ world_from_clip
    clip_from_screen = np.eye(4)[:, [0, 1, 3]]
    clip_from_screen[2] = -plane[[0, 1, 3]] / plane[2]
    axes = _axes(ground)
    metres_from_world = np.zeros((3, 4))
    metres_from_world[:2, :3], metres_from_world[:2, 3] = axes, -axes @ _middle(ground, surface)
    metres_from_world[2, 3] = 1
    return metres_from_world @ world_from_clip @ clip_from_screen


def _axes(ground: Ground) -> NDArray[np.float64]:
    """Two unit vectors (2, 3) along the ground."""
    axis = np.eye(3)[2] if abs(ground.normal[2]) < 0.9 else np.eye(3)[0]
    right = np.cross(ground.normal, axis)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(ground.normal, right)])


def _middle(ground: Ground, surface: GroundSurface) -> NDArray[np.float64]:
    return np.array(surface.middle) - (ground.normal @ surface.middle - ground.offset) * ground.normal
