"""The ground of a scene: what of it a camera sees."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from impostor.scene import SceneGround, Vector
from impostor.srgb import linear_from_srgb
from runtime.ground.ground_pass import GroundSurface
from runtime.surfaces.surface_pass import lying_on
from runtime.viewing.cameras import Camera

GREY = (0.5, 0.5, 0.5)


def ground_surface(
    ground: SceneGround,
    texture: NDArray[np.uint8] | None,
    camera: Camera,
    background: tuple[float, float, float, float],
    output: str,
) -> GroundSurface:
    """What the ground looks like around a camera.

    Parameters
    ----------
    ground : SceneGround
    texture : ndarray, (H, W, 4) uint8, optional
    camera : Camera
    background : tuple of float
        What it fades into, as `GroundSurface` has it.
    output : {"lit", "normal"}
    """
    albedo, middle = ground.albedo, under(ground, camera)
    if output == "normal":
        # One colour all over; the ground knows no other output than light.
        shown = camera.view_from_world[:3, :3] @ ground.plane.normal / 2 + 0.5
        red, green, blue = linear_from_srgb(shown).tolist()
        albedo, texture, background = (red, green, blue), None, (*GREY, 1.0)
    return GroundSurface(albedo, texture, ground.tile, middle, ground.reach, background)


def under(ground: SceneGround, camera: Camera) -> Vector:
    """The point of the ground below the eye; where the ground has a picture, moved by less than a repeat of it.

    There the ground is laid anew in every picture, so that it reaches equally far on all sides and stands still.
    """
    x, y, z = (-camera.view_from_world[:3, :3].T @ camera.view_from_world[:3, 3]).tolist()
    if ground.texture is None and ground.ptm is None:
        return x, y, z
    lying = lying_on(ground.plane)
    along = lying[:3, :2].T @ ((x, y, z) - lying[:3, 3])
    x, y, z = (lying[:3, 3] + lying[:3, :2] @ (np.round(along / ground.tile) * ground.tile)).tolist()
    return x, y, z
