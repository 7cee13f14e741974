"""Instances: where the copies of one fan stand, and which picture of it each shows to a viewer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.errors import SettingsError
from impostor.fan import Fan
from impostor.lighting import Gloss
from impostor.views import rotation_about_y


class Instances:
    """N copies of one fan. The arrays may be written in place at any time; the next draw shows it.

    Parameters
    ----------
    fan : Fan
    positions : array_like, (N, 3) or (3,) float
        Where the model's origin stands, world space.
    yaws : array_like, (N,) or () float
        Turn about +Y in radians.
    scales : array_like, (N,) or () float
        Uniform, greater than 0.
    gloss : Gloss, optional

    Attributes
    ----------
    positions : ndarray, (N, 3) float64
    yaws, scales : ndarray, (N,) float64
    visible : ndarray, (N,) bool

    Raises
    ------
    SettingsError
        Arrays whose lengths differ, a number that is not finite, a scale that is not positive.
    """

    def __init__(
        self,
        fan: Fan,
        positions: ArrayLike = (0.0, 0.0, 0.0),
        yaws: ArrayLike = 0.0,
        scales: ArrayLike = 1.0,
        gloss: Gloss | None = None,
    ):
        self.fan, self.gloss = fan, gloss or Gloss()
        given = np.asarray(positions, float)
        self.positions = np.array(np.atleast_2d(given) if given.size else given.reshape(0, 3))
        count = len(self.positions)
        if self.positions.shape != (count, 3):
            raise SettingsError(fan.name, f"positions of shape {self.positions.shape}; expected (N, 3)")
        self.yaws, self.scales = _one_each("yaws", yaws, count, fan), _one_each("scales", scales, count, fan)
        self.visible = np.ones(count, bool)
        for name in ("positions", "yaws", "scales"):
            if not np.all(np.isfinite(getattr(self, name))):
                raise SettingsError(fan.name, f"{name} hold a number that is not finite; expected finite ones")
        if np.any(self.scales <= 0):
            raise SettingsError(fan.name, f"scales go down to {self.scales.min():g}; expected more than 0")

    def __len__(self) -> int:
        return len(self.positions)


def _one_each(name: str, values: ArrayLike, count: int, fan: Fan) -> NDArray[np.float64]:
    array = np.asarray(values, float)
    if array.shape not in ((), (count,)):
        raise SettingsError(fan.name, f"{name} of shape {array.shape}; expected ({count},), one for each position")
    return np.array(np.broadcast_to(array, (count,)))


@dataclass(frozen=True)
class Viewer:
    """A camera as the passes need it, from the caller's two matrices.

    Parameters
    ----------
    clip_from_view, view_from_world : ndarray, (4, 4) float64
        Column-vector matrices in reading order; OpenGL clip space.
    viewport : tuple of int
        x, y, width, height in pixels.
    """

    clip_from_view: NDArray[np.float64]
    view_from_world: NDArray[np.float64]
    viewport: tuple[int, ...]

    @classmethod
    def from_matrices(cls, clip_from_view: ArrayLike, view_from_world: ArrayLike, viewport: tuple[int, ...]) -> Viewer:
        """Check the caller's matrices.

        Raises
        ------
        SettingsError
            Not 4x4, not finite, or a view that cannot be inverted.
        """
        matrices = []
        for name, matrix in (("clip_from_view", clip_from_view), ("view_from_world", view_from_world)):
            array = np.asarray(matrix, float)
            if array.shape != (4, 4) or not np.all(np.isfinite(array)):
                raise SettingsError(name, f"shape {array.shape}; expected a (4, 4) matrix of finite numbers")
            if abs(np.linalg.det(array)) < 1e-30:
                raise SettingsError(name, "its determinant is 0; expected a matrix that can be inverted")
            matrices.append(array)
        return cls(matrices[0], matrices[1], tuple(viewport))

    @property
    def clip_from_world(self) -> NDArray[np.float64]:
        """(4, 4) float64."""
        return self.clip_from_view @ self.view_from_world

    @property
    def eye(self) -> NDArray[np.float64]:
        """The point where all lines of sight meet, homogeneous (4,) in world space.

        (x, y, z, 1) of a perspective camera; (dx, dy, dz, 0), the unit direction toward it, of an orthographic one.
        """
        # In clip space every line of sight runs along z, so they meet at its point at infinity.
        x, y, z, w = np.linalg.solve(self.clip_from_world, [0.0, 0.0, 1.0, 0.0])
        if abs(w) > 1e-9 * max(abs(x), abs(y), abs(z)):
            return np.array([x / w, y / w, z / w, 1.0])
        direction = np.array([x, y, z])
        direction *= np.sign(direction @ self.view_from_world[2, :3]) / np.linalg.norm(direction)
        return np.append(direction, 0.0)

    def pixels_per_metre(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Size on screen (N,) of one metre across the line of sight at points (N, 3); 0 behind the camera."""
        height = self.viewport[3] / 2 * abs(self.clip_from_view[1, 1])
        w = points @ self.clip_from_world[3, :3] + self.clip_from_world[3, 3]
        return np.where(w > 1e-9, height / np.maximum(w, 1e-9), 0.0)

    def sees(self, points: NDArray[np.float64], radii: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether spheres around points (N, 3) with radii (N,) touch the view frustum."""
        rows = self.clip_from_world
        inside = np.ones(len(points), bool)
        for plane in (rows[3] + rows[0], rows[3] - rows[0], rows[3] + rows[1], rows[3] - rows[1], rows[3] + rows[2]):
            length = np.linalg.norm(plane[:3])
            if length > 0:
                inside &= points @ plane[:3] + plane[3] > -radii * length
        return inside


@dataclass(frozen=True)
class Quads:
    """What one viewer is shown of some instances: one fan view each, as a quad in the world.

    Parameters
    ----------
    index : ndarray, (N,) intp
        Which instances.
    view : ndarray, (N,) intp
        The nearest view of the fan.
    basis : ndarray, (N, 3, 3) float64
        That view's right, up and back as turned in the world; orthonormal.
    origin : ndarray, (N, 3) float64
        World position of the view's centre.
    center, right, up : ndarray, (N, 3) float64
        The quad: tile coordinates (x, y), in the view's metres, are drawn at `center + x right + y up`.
    toward_eye : ndarray, (N, 3) float64
        Unit vectors.
    scale : ndarray, (N,) float64
    """

    index: NDArray[np.intp]
    view: NDArray[np.intp]
    basis: NDArray[np.float64]
    origin: NDArray[np.float64]
    center: NDArray[np.float64]
    right: NDArray[np.float64]
    up: NDArray[np.float64]
    toward_eye: NDArray[np.float64]
    scale: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.index)

    def take(self, which: NDArray[Any]) -> Quads:
        """Some of them, by index or mask."""
        return Quads(*(getattr(self, name)[which] for name in self.__dataclass_fields__))


def nearest_views(
    instances: Instances, eye: NDArray[np.float64], index: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """The fan view nearest to an eye, or to a light, of each instance.

    Parameters
    ----------
    instances : Instances
    eye : ndarray, (4,) float64
        Homogeneous, `Viewer.eye`; (x, y, z, 0) for a direction.
    index : ndarray, (N,) intp
        Which instances.

    Returns
    -------
    view : ndarray, (N,) intp
    toward : ndarray, (N, 3) float64
        Unit vectors from the instance toward the eye, world space.
    """
    rotation = rotation_about_y(instances.yaws[index])
    middle = instances.fan.views.center.mean(axis=0)
    where = instances.positions[index] + instances.scales[index, None] * (rotation @ middle)
    toward = eye[:3] - eye[3] * where
    toward /= np.maximum(np.linalg.norm(toward, axis=-1, keepdims=True), 1e-12)
    return instances.fan.views.nearest(np.einsum("nji,nj->ni", rotation, toward)), toward


def quads_toward(instances: Instances, eye: NDArray[np.float64]) -> Quads:
    """The nearest view of every visible instance, set up in the world (the paper's figure 2).

    The quad lies in the plane that follows the surface its view shows, turned with the instance: seen from the view's
    own camera that makes no difference, and from beside it what lies in the plane is drawn where the mesh would be.
    Copies with a position, yaw or scale that is not finite are left out.

    Parameters
    ----------
    instances : Instances
    eye : ndarray, (4,) float64
        Homogeneous, `Viewer.eye`.

    Returns
    -------
    Quads
    """
    finite = np.isfinite(instances.positions).all(axis=1) & np.isfinite(instances.yaws) & np.isfinite(instances.scales)
    views, index = instances.fan.views, np.flatnonzero(instances.visible & finite)
    view, toward = nearest_views(instances, eye, index)
    rotation, scale = rotation_about_y(instances.yaws[index]), instances.scales[index]
    origin = instances.positions[index] + scale[:, None] * np.einsum("nij,nj->ni", rotation, views.center[view])
    basis = np.einsum("nij,nkj->nki", rotation, views.basis[view])
    offset, slope_right, slope_up = views.plane[view].T[..., None] * scale[:, None]
    right, up, back = basis[:, 0] * scale[:, None], basis[:, 1] * scale[:, None], basis[:, 2]
    # A perspective camera's picture shrinks with the distance of the plane it falls on.
    spread = 1 - views.plane[view, :1] / views.distance
    quad = origin + offset * back, spread * right + slope_right * back, spread * up + slope_up * back
    return Quads(index, view, basis, origin, *quad, toward, scale)
