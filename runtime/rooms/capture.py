"""Environments taken from a scene: what a room's cube map is made of where nobody has photographed one."""

from __future__ import annotations

from collections.abc import Callable

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.environment.cube import FACE_AXES
from impostor.environment.environment import FACE_SIZES, Environment, is_face_size
from impostor.errors import SettingsError
from impostor.srgb import linear_from_srgb
from runtime.checks import numbers
from runtime.gl.offscreen import Offscreen
from runtime.gl.state import preserved_state

Draw = Callable[[NDArray[np.float64], NDArray[np.float64]], object]


def capture_environment(
    ctx: moderngl.Context,
    draw: Draw,
    position: ArrayLike,
    size: int = 256,
    near: float = 0.05,
    far: float = 100.0,
    environment_from_world: ArrayLike | None = None,
    name: str = "captured",
) -> Environment:
    """Take the pictures of a cube map from a point in a scene.

    Parameters
    ----------
    ctx : moderngl.Context
    draw : callable
        Takes clip_from_view and view_from_world, (4, 4) float64 each, and draws the scene into the bound framebuffer,
        on the sRGB curve; it is called six times.
    position : array_like, (3,) float
        World space, metres. A room that shows the environment has this point, in room space, as `captured_at`.
    size : int
        Of a face in texels; a power of two from 8 to 4096. Each is the mean of four.
    near, far : float
        Metres.
    environment_from_world : array_like, (3, 3) float, optional
        For a room that is turned: its `environment_from_world`.
    name : str

    Returns
    -------
    Environment
        Radiance up to 1, which is all that the sRGB curve holds; black where nothing is drawn.

    Raises
    ------
    SettingsError
        An impossible size, range, position or rotation.

    References
    ----------
    Bjorke, "Image-Based Lighting", GPU Gems 19, section 19.6: cube maps made from 3D geometry.
    """
    if not is_face_size(size):
        raise SettingsError("capture", f"size {size!r}; expected {FACE_SIZES}")
    eye = numbers("capture", "position", position, (3,))
    turn = np.eye(3) if environment_from_world is None else environment_from_world
    turn = numbers("capture", "environment_from_world", turn, (3, 3))
    if np.abs(turn @ turn.T - np.eye(3)).max() > 1e-6 or np.linalg.det(turn) < 0:
        raise SettingsError("capture", "environment_from_world is no rotation; expected one")
    if not 0 < near < far < np.inf:
        raise SettingsError("capture", f"near {near:g} m, far {far:g} m; expected 0 < near < far")
    clip_from_view = _quarter_turn(near, far)
    with preserved_state(ctx):
        screen = Offscreen(ctx, size, size, samples=2)
        try:
            faces = [_face(screen, draw, clip_from_view, axes @ turn, eye) for axes in FACE_AXES]
        finally:
            screen.release()
    return Environment(name, np.stack(faces))


def _face(
    screen: Offscreen,
    draw: Draw,
    clip_from_view: NDArray[np.float64],
    axes: NDArray[np.float64],
    eye: NDArray[np.float64],
) -> NDArray[np.float32]:
    """A face whose columns, rows and middle lie along some axes, (S, S, 3) linear."""
    # A camera's columns run the other way: seen from inside, a face is its picture mirrored.
    basis = -axes
    view_from_world = np.eye(4)
    view_from_world[:3, :3], view_from_world[:3, 3] = basis, -basis @ eye
    screen.clear()
    draw(clip_from_view, view_from_world)
    return linear_from_srgb(screen.color()[:, ::-1, :3] / np.float32(255))


def _quarter_turn(near: float, far: float) -> NDArray[np.float64]:
    """The projection of a camera that sees one face of a cube."""
    clip = np.diag([1.0, 1.0, -(far + near) / (far - near), 0.0])
    clip[2, 3], clip[3, 2] = -2 * far * near / (far - near), -1
    return clip
