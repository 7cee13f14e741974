"""The five steps that take a silhouette's strips to an object's shadow on the ground.

Circled positions of figure 8: (1) silhouette pixel and depth, in model space; (2) along the light onto the ground;
(3) in the plane of the viewer image, through the fan camera nearest to the viewer; (4) on that quad as it is turned
in the world; (5) from the viewer through it onto the ground. Steps 3 to 5 are linear in homogeneous coordinates.

Steps 3 to 5 make the shadow meet the feet of the picture, which shows the object from the fan camera. The ground
around it they bend as well: a shadow that is long, seen from much lower or nearer than the fan camera, would point
another way. So they move the shadow of the feet only; what stands higher casts its own where the light does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.errors import SettingsError
from impostor.fan import DEPTH_CODES
from impostor.strips import Strips
from impostor.views import View

LEVEL_CAMERA = 0.05
"""Sine of a camera's elevation over the ground below which it sees the ground as little more than a line."""
FEET = 0.25
"""Part of an object's height from which on its shadow lies where the light casts it, wherever its picture stands."""
LOWEST_LIGHT = 1e-3
"""Sine of the light's lowest elevation over the ground; there a shadow is a thousand times as long as its object."""


@dataclass(frozen=True, eq=False)
class Ground:
    """The plane that receives shadows, in world space: `normal . x = offset`.

    Parameters
    ----------
    normal : array_like, (3,) float
        Toward the lit side; any length, kept as a unit vector.
    offset : float
        In units of the normal's given length.

    Raises
    ------
    SettingsError
        A normal of no length.
    """

    normal: NDArray[np.floating[Any]]
    offset: float = 0.0

    def __post_init__(self):
        normal = np.array(self.normal, float)
        length = float(np.linalg.norm(normal))
        if normal.shape != (3,) or not 0 < length < np.inf:
            raise SettingsError("ground normal", f"{normal.tolist()}; expected three numbers, not all zero")
        object.__setattr__(self, "normal", normal / length)
        object.__setattr__(self, "offset", float(self.offset) / length)

    @property
    def plane(self) -> NDArray[np.float64]:
        """(4,) float64: its product with a homogeneous point is the point's height."""
        return np.append(self.normal, -self.offset)


@dataclass(frozen=True, eq=False)
class Quad:
    """The quad that shows a viewer image, as it is turned in the world.

    Parameters
    ----------
    center : ndarray, (3,) float
        Where the middle of the tile is.
    right, up : ndarray, (3,) float
        World vectors of one metre of the view's plane; they hold the instance's scale.
    """

    center: NDArray[np.floating[Any]]
    right: NDArray[np.floating[Any]]
    up: NDArray[np.floating[Any]]

    @classmethod
    def unturned(cls, view: View, world_from_model: NDArray[np.floating[Any]]) -> Quad:
        """The quad of a view where the view's own camera has its image plane."""
        right, up = view.basis[:2] @ world_from_model[:3, :3].T
        return cls(world_from_model[:3, :3] @ view.center + world_from_model[:3, 3], right, up)

    def world_from_plane(self) -> NDArray[np.float64]:
        """Step 4: (4, 3) float64, from the plane's homogeneous (x, y, 1) in metres to world space."""
        matrix = np.zeros((4, 3))
        matrix[:3] = np.stack([self.right, self.up, self.center], axis=-1)
        matrix[3, 2] = 1
        return matrix


def casts_shadow(toward_light: ArrayLike, ground: Ground) -> bool:
    """Whether a light is high enough over the ground: `LOWEST_LIGHT` or more."""
    toward_light = np.asarray(toward_light, float)
    return bool(ground.normal @ toward_light >= LOWEST_LIGHT * np.linalg.norm(toward_light))


def strip_points(strips: Strips, view: View, depth: NDArray[np.uint16]) -> NDArray[np.float64]:
    """Step 1: the strips' vertices in model space, each at the depth of its pixel.

    Parameters
    ----------
    strips : Strips
        Of the silhouette of `view`.
    view : View
        The view nearest to the light.
    depth : ndarray, (S, S) uint16
        Its depth layer.

    Returns
    -------
    ndarray, (N, 3) float64
    """
    size = len(depth)
    low, high = view.depth_range
    xyz = np.empty((len(strips.pixels), 3))
    xyz[:, :2] = (strips.positions * (2 / size) - 1) * (view.radius, -view.radius)
    xyz[:, 2] = low + depth[strips.pixels[:, 1], strips.pixels[:, 0]] * ((high - low) / DEPTH_CODES)
    return view.unproject(xyz)


def along_light(points: ArrayLike, toward_light: ArrayLike, ground: Ground) -> NDArray[np.float64]:
    """Step 2: world-space points along a directional light onto the ground.

    Parameters
    ----------
    points : array_like, (..., 3) float
        World space. What is under the ground casts no shadow, and its points go the other way: so a straight edge that
        enters the ground keeps its place, and its shadow ends there.
    toward_light : array_like, (3,) float
        World space; need not be unit length. `casts_shadow` must hold for it.
    ground : Ground

    Returns
    -------
    ndarray, (..., 3) float64
    """
    points, toward_light = np.asarray(points, float), np.asarray(toward_light, float)
    height = (points @ ground.normal - ground.offset)[..., None]
    return points - height * (toward_light / (ground.normal @ toward_light))


def plane_from_world(view: View, world_from_model: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    """Step 3: the projection through a fan camera onto the plane of its image.

    Parameters
    ----------
    view : View
        The view nearest to the viewer, whose image is drawn.
    world_from_model : ndarray, (4, 4) float
        Translation, rotation and uniform scale of the instance.

    Returns
    -------
    ndarray, (3, 4) float64
        To homogeneous (x, y, w) of `View.project`'s metres. w is 0 or less for points level with or behind a
        perspective camera; they need no case of their own, for step 5 restores them.
    """
    rows = view.clip_from_model()[[0, 1, 3]]
    rows[:2] *= view.radius
    return rows @ np.linalg.inv(world_from_model)


def quad_back(view: View, world_from_model: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    """The direction (3,) from the object toward a fan camera, as the instance is turned in the world."""
    back = world_from_model[:3, :3] @ view.basis[2]
    return back / np.linalg.norm(back)


def ground_from_sight(eye: ArrayLike, ground: Ground) -> NDArray[np.float64]:
    """Step 5: along the lines of sight onto the ground.

    Parameters
    ----------
    eye : array_like, (4,) float
        World space: (x, y, z, 1), or (x, y, z, 0) toward an orthographic viewer.
    ground : Ground

    Returns
    -------
    ndarray, (4, 4) float64
        From homogeneous world space, w positive, to homogeneous points on the ground. For an eye over the ground
        the result's w is positive where the line of sight goes down to meet it, 0 at the horizon, negative above.
    """
    eye = np.asarray(eye, float)
    return (ground.plane @ eye) * np.eye(4) - np.outer(eye, ground.plane)


def viewer_ground_from_ground(
    view: View, world_from_model: NDArray[np.floating[Any]], quad: Quad, eye: ArrayLike, ground: Ground
) -> NDArray[np.float64]:
    """Steps 3 to 5 in one matrix: from the true shadow to where it meets the quad's feet.

    Parameters
    ----------
    view : View
        The view nearest to the viewer, whose image is drawn.
    world_from_model : ndarray, (4, 4) float
        Translation, rotation and uniform scale of the instance.
    quad : Quad
        What the image is drawn on.
    eye : array_like, (4,) float
        World space: (x, y, z, 1), or (x, y, z, 0) toward an orthographic viewer.
    ground : Ground

    Returns
    -------
    ndarray, (4, 4) float64
        Homogeneous world space to homogeneous world space, of w about 1 below the middle of the view; the identity when
        the eye is the view's camera and the quad is unturned.

    Notes
    -----
    A fan camera that is level with the ground sees it as a line: below `LEVEL_CAMERA` the true shadow stays. So it
    does where the ground below the object is beyond the viewer's horizon.
    """
    if abs(quad_back(view, world_from_model) @ ground.normal) < LEVEL_CAMERA:
        return np.eye(4)
    matrix = ground_from_sight(eye, ground) @ quad.world_from_plane() @ plane_from_world(view, world_from_model)
    middle = world_from_model[:3, :3] @ view.center + world_from_model[:3, 3]
    below = middle - (middle @ ground.normal - ground.offset) * ground.normal
    w = matrix[3, :3] @ below + matrix[3, 3]
    return matrix / w if w > 0 else np.eye(4)


def above_feet(heights: ArrayLike, feet: float) -> NDArray[np.float64]:
    """How far (N,) shadows of points over the ground have left the place that the feet's has for the true one.

    Parameters
    ----------
    heights : array_like, (N,) float
        Metres.
    feet : float
        Metres, `FEET` of the object's height; greater than 0.
    """
    part = np.clip(np.asarray(heights, float) / feet, 0, 1)
    return part * part * (3 - 2 * part)


def shadow_on_ground(
    strips: Strips,
    light_view: View,
    depth: NDArray[np.uint16],
    viewer_view: View,
    quad: Quad,
    *,
    world_from_model: NDArray[np.floating[Any]],
    toward_light: ArrayLike,
    eye: ArrayLike,
    ground: Ground,
    feet: float,
) -> NDArray[np.float64]:
    """The shadow's vertices on the ground, lined up with the quad as the viewer sees it.

    The reference for `runtime/shaders/shadow_strips.vert`, which the tests hold against it; nothing is drawn with it.

    Parameters
    ----------
    strips : Strips
        Of the silhouette of `light_view`.
    light_view : View
        The view nearest to the light.
    depth : ndarray, (S, S) uint16
        The depth layer of `light_view`.
    viewer_view : View
        The view nearest to the viewer, whose image is drawn on `quad`.
    quad : Quad
    world_from_model : ndarray, (4, 4) float
        Translation, rotation and uniform scale of the instance.
    toward_light : array_like, (3,) float
        World space; need not be unit length.
    eye : array_like, (4,) float
        World space: (x, y, z, 1), or (x, y, z, 0) toward an orthographic viewer.
    ground : Ground
    feet : float
        Metres in the world; see `above_feet`.

    Returns
    -------
    ndarray, (N, 4) float64
        Homogeneous world space, one row for each vertex of the strips. Not divided by w: a clip space made from it
        clips what lies beyond the viewer's horizon. (0, 4) when there is no shadow to see: a light lower than
        `LOWEST_LIGHT`, or an eye not above the ground.

    References
    ----------
    Dinh, Metoyer, Turk, "Shadows", figure 8.
    """
    if not casts_shadow(toward_light, ground) or ground.plane @ np.asarray(eye, float) <= 0:
        return np.empty((0, 4))
    model = strip_points(strips, light_view, depth)
    world = model @ world_from_model[:3, :3].T + world_from_model[:3, 3]
    shadow = along_light(world, toward_light, ground)
    matrix = viewer_ground_from_ground(viewer_view, world_from_model, quad, eye, ground)
    at_feet = shadow @ matrix[:, :3].T + matrix[:, 3]
    part = above_feet(world @ ground.normal - ground.offset, feet)[:, None]
    return (1 - part) * at_feet + part * np.insert(shadow, 3, 1, axis=1)
