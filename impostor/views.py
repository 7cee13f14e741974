"""The cameras of a fan: where they stand, what they frame, which one is nearest to a viewer."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, QhullError

from impostor.errors import SettingsError

LAYOUTS = ("ring", "hemisphere", "sphere")
MAX_VIEWS = 2048


def direction(azimuth: ArrayLike, elevation: ArrayLike) -> NDArray[np.float64]:
    """Unit vectors from the origin toward azimuth and elevation.

    Parameters
    ----------
    azimuth, elevation : array_like, (...,) float
        Radians. Azimuth turns about +Y from +Z toward +X; elevation rises from the horizon.

    Returns
    -------
    ndarray, (..., 3) float64
    """
    azimuth, elevation = np.broadcast_arrays(np.asarray(azimuth, float), np.asarray(elevation, float))
    level = np.cos(elevation)
    return np.stack([level * np.sin(azimuth), np.sin(elevation), level * np.cos(azimuth)], axis=-1)


def basis_facing(back: ArrayLike) -> NDArray[np.float64]:
    """Camera bases whose rows are right, up and back.

    Parameters
    ----------
    back : array_like, (..., 3) float
        From the object toward the camera; need not be unit length.

    Returns
    -------
    ndarray, (..., 3, 3) float64
        Orthonormal and right-handed. A camera straight above or below takes +X as its right.
    """
    along: NDArray[np.float64] = np.asarray(back, float)
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    right = np.stack([along[..., 2], np.zeros_like(along[..., 0]), -along[..., 0]], axis=-1)
    length = np.linalg.norm(right, axis=-1, keepdims=True)
    right = np.where(length > 1e-9, right / np.maximum(length, 1e-12), np.array([1.0, 0.0, 0.0]))
    return np.stack([right, np.cross(along, right), along], axis=-2)


def rotation_about_y(yaw: ArrayLike) -> NDArray[np.float64]:
    """Matrices that turn a model about +Y, from +Z toward +X.

    Parameters
    ----------
    yaw : array_like, (...,) float
        Radians.

    Returns
    -------
    ndarray, (..., 3, 3) float64
        `world_from_model` rotations.
    """
    yaw = np.asarray(yaw, float)
    cos, sin, zero, one = np.cos(yaw), np.sin(yaw), np.zeros_like(yaw), np.ones_like(yaw)
    rows = [cos, zero, sin, zero, one, zero, -sin, zero, cos]
    return np.stack(rows, axis=-1).reshape(*yaw.shape, 3, 3)


@dataclass(frozen=True)
class View:
    """One camera of a fan, in model space.

    Parameters
    ----------
    basis : ndarray, (3, 3) float
        Rows right, up, back. Back points from the centre to the camera.
    center : ndarray, (3,) float
        The point that projects to the middle of the tile.
    radius : float
        Half the side of the square tile, in metres on the plane through the centre.
    depth_range : tuple of float
        Lowest and highest coordinate along back, relative to the centre, that the depth layer spans.
    distance : float
        From the centre to the eye; infinite for an orthographic camera.
    plane : tuple of float
        Offset and slopes (to the right, up) of the plane z = offset + slope . (x, y) that follows the surface this
        camera sees. A quad in it stays true farther away from the camera than one through the centre.
    """

    basis: NDArray[np.floating[Any]]
    center: NDArray[np.floating[Any]]
    radius: float
    depth_range: tuple[float, float]
    distance: float = np.inf
    plane: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def clip_from_model(self) -> NDArray[np.float64]:
        """The camera's projection: (4, 4) float64, OpenGL clip space, depth range filled exactly."""
        low, high = self.depth_range
        view_from_model = np.eye(4)
        view_from_model[:3, :3] = self.basis
        view_from_model[:3, 3] = -self.basis @ self.center
        clip_from_view = np.zeros((4, 4))
        if np.isinf(self.distance):
            clip_from_view[0, 0] = clip_from_view[1, 1] = 1 / self.radius
            clip_from_view[2, 2:] = -2 / (high - low), (high + low) / (high - low)
            clip_from_view[3, 3] = 1
        else:
            near, far = self.distance - high, self.distance - low
            clip_from_view[0, 0] = clip_from_view[1, 1] = self.distance / self.radius
            # clip z over clip w, where w = distance - z, is -1 at near and +1 at far.
            slope, offset = (far + near) / (far - near), -2 * far * near / (far - near)
            clip_from_view[2, 2:] = -slope, slope * self.distance + offset
            clip_from_view[3, 2:] = -1, self.distance
        return clip_from_view @ view_from_model

    def project(self, points: ArrayLike) -> NDArray[np.float64]:
        """Model-space points (..., 3) onto the tile's plane: (..., 3) of x, y in metres and z along back."""
        xyz = (np.asarray(points, float) - self.center) @ self.basis.T
        if np.isfinite(self.distance):
            xyz[..., :2] *= (self.distance / (self.distance - xyz[..., 2]))[..., None]
        return xyz

    def unproject(self, xyz: ArrayLike) -> NDArray[np.float64]:
        """The inverse of `project`: plane coordinates and z (..., 3) to model space (..., 3)."""
        xyz = np.array(xyz, float)
        if np.isfinite(self.distance):
            xyz[..., :2] *= ((self.distance - xyz[..., 2]) / self.distance)[..., None]
        return xyz @ self.basis + self.center


@dataclass(frozen=True)
class Views:
    """All cameras of a fan as arrays: V views, one row each.

    Parameters
    ----------
    basis : ndarray, (V, 3, 3) float64
    center : ndarray, (V, 3) float64
    radius : ndarray, (V,) float64
    depth_range : ndarray, (V, 2) float64
    distance : float
        Shared by all views; infinite for orthographic ones.
    plane : ndarray, (V, 3) float64
        Offset and slopes of the plane that follows what is seen, as `View.plane`; through the centre if not given.
    """

    basis: NDArray[np.float64]
    center: NDArray[np.float64]
    radius: NDArray[np.float64]
    depth_range: NDArray[np.float64]
    distance: float = np.inf
    plane: NDArray[np.float64] = None  # type: ignore[assignment]

    def __post_init__(self):
        if self.plane is None:
            object.__setattr__(self, "plane", np.zeros((len(self.basis), 3)))

    def __len__(self) -> int:
        return len(self.basis)

    def __iter__(self) -> Iterator[View]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> View:
        low, high = self.depth_range[index]
        return View(
            self.basis[index],
            self.center[index],
            float(self.radius[index]),
            (float(low), float(high)),
            self.distance,
            tuple(self.plane[index].tolist()),
        )

    def nearest(self, toward_eye: ArrayLike) -> NDArray[np.intp]:
        """The view whose camera is nearest to each direction.

        Parameters
        ----------
        toward_eye : array_like, (..., 3) float
            From the object toward the viewer (or the light), in model space; need not be unit length.

        Returns
        -------
        ndarray, (...) intp
        """
        return np.argmax(np.asarray(toward_eye, float) @ self.basis[:, 2].T, axis=-1)


def ring_bases(count: int, elevation: float) -> NDArray[np.float64]:
    """Bases (count, 3, 3) of a circle of cameras at one elevation (radians); view 0 looks from +Z.

    References
    ----------
    Dinh, Metoyer, Turk, figure 1.
    """
    return basis_facing(direction(2 * np.pi * np.arange(count) / count, elevation))


def spiral_bases(count: int, lowest: float) -> NDArray[np.float64]:
    """Bases (count, 3, 3) spread evenly by a golden-angle spiral from sin(elevation) = `lowest` to the zenith."""
    height = lowest + (1 - lowest) * (np.arange(count) + 0.5) / count
    azimuth = np.pi * (1 + np.sqrt(5)) * np.arange(count)
    return basis_facing(direction(azimuth, np.arcsin(height)))


def layout_bases(layout: str, count: int, elevation: float) -> NDArray[np.float64]:
    """Camera bases of a named layout.

    Parameters
    ----------
    layout : {"ring", "hemisphere", "sphere"}
    count : int
        Number of views, 1 to 2048.
    elevation : float
        Radians; only a ring uses it.

    Returns
    -------
    ndarray, (count, 3, 3) float64

    Raises
    ------
    SettingsError
        An unknown layout, a count or an elevation out of range.
    """
    if not 1 <= count <= MAX_VIEWS:
        raise SettingsError("views", f"{count} views; expected 1 to {MAX_VIEWS}")
    if layout == "ring":
        if not abs(elevation) < np.pi / 2:
            raise SettingsError("elevation", f"{np.degrees(elevation):g} degrees; expected between -90 and 90")
        return ring_bases(count, elevation)
    if layout == "hemisphere":
        return spiral_bases(count, lowest=0.0)
    if layout == "sphere":
        return spiral_bases(count, lowest=-1.0)
    raise SettingsError("layout", f"{layout!r}; expected one of {', '.join(LAYOUTS)}")


def frame(
    bases: NDArray[np.float64], points: NDArray[Any], size: int, distance: float = np.inf, margin: int = 2
) -> Views:
    """Views with these bases whose tiles the points fill.

    Every view is centred on what it sees; all share the radius of the widest one, so that texels are equally large.

    Parameters
    ----------
    bases : ndarray, (V, 3, 3) float
    points : ndarray, (N, 3) float
        The object's vertices.
    size : int
        Side of a tile in texels.
    distance : float
        From the middle of the object's bounding box to the eye, in metres.
    margin : int
        Texels kept free on every side.

    Returns
    -------
    Views

    Raises
    ------
    SettingsError
        The eye of a perspective camera stands inside the object's bounding sphere.
    """
    points = points if points.dtype == np.float32 else np.asarray(points, float)
    middle = (points.min(axis=0).astype(float) + points.max(axis=0)) / 2
    # Of points of 64 bits, 32 are enough only once the middle is taken off.
    points = _outermost((points - middle.astype(points.dtype)).astype(np.float32))
    reach = float(np.sqrt(np.einsum("ij,ij->i", points, points).max())) or 1.0
    if not distance > reach * 1.05:
        raise SettingsError("distance", f"{distance:g} m; expected more than {reach * 1.05:.4g} m for this object")
    low, high = np.empty((2, len(bases), 3))
    for index, basis in enumerate(bases.astype(np.float32)):
        xyz = points @ basis.T
        if np.isfinite(distance):
            xyz[:, :2] *= np.float32(distance) / (np.float32(distance) - xyz[:, 2:])
        low[index], high[index] = xyz.min(axis=0), xyz.max(axis=0)
    if np.isfinite(distance):
        # An eye moved sideways sees another outline: keep the common centre, widen the tile instead.
        offset = np.zeros((len(bases), 3))
        half = np.abs(np.stack([low, high]))[..., :2].max()
    else:
        offset = (low + high) / 2
        half = ((high - low) / 2)[:, :2].max()
    radius = max(half, reach * 1e-3) * size / max(size - 2 * margin, 1)
    slack = reach * 1e-3
    depth_range = np.stack([low[:, 2] - offset[:, 2] - slack, high[:, 2] - offset[:, 2] + slack], axis=-1)
    center = middle + np.einsum("vi,vij->vj", offset, bases)
    return Views(np.asarray(bases, float), center, np.full(len(bases), radius), depth_range, float(distance))


def _outermost(points: NDArray[np.float32]) -> NDArray[np.float32]:
    """The corners of the convex hull: they reach as far as all points do, and are few."""
    if len(points) > 1000:
        with contextlib.suppress(QhullError):  # a flat object has no hull
            return points[ConvexHull(points).vertices]
    return points
