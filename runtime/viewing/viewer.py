"""The viewer: a camera as the passes need it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.errors import SettingsError
from runtime.checks import numbers


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
            Not 4x4, not finite, without an inverse, or a view for row vectors.
        """
        clip = numbers("camera", "clip_from_view", clip_from_view, (4, 4))
        view = numbers("camera", "view_from_world", view_from_world, (4, 4))
        *turned, one = view[3].tolist()
        if max(map(abs, turned)) > 1e-6 or abs(one - 1) > 1e-6:
            row = ", ".join(f"{value:g}" for value in view[3])
            expected = "(0, 0, 0, 1): column vectors, not rows"
            raise SettingsError("camera", f"view_from_world has the last row ({row}); expected {expected}")
        viewer = cls(clip, view, tuple(viewport))
        scaled = viewer.clip_from_world / np.maximum(np.maximum.reduce(np.abs(viewer.clip_from_world)), 1e-300)
        # Whatever its units, rounding leaves a singular matrix about 1e-16 of the volume that its rows could span.
        if not abs(np.linalg.det(scaled)) > 1e-13 * np.maximum.reduce(np.abs(scaled), axis=1).prod():
            raise SettingsError("camera", "clip_from_view @ view_from_world has no inverse; expected one that has")
        return viewer

    @property
    def key(self) -> tuple[object, ...]:
        """Equal for two viewers that see the same."""
        return self.clip_from_view.tobytes(), self.view_from_world.tobytes(), self.viewport

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the viewport in pixels, at least 1."""
        return max(self.viewport[2], 1), max(self.viewport[3], 1)

    @cached_property
    def clip_from_world(self) -> NDArray[np.float64]:
        """(4, 4) float64."""
        return self.clip_from_view @ self.view_from_world

    @cached_property
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

    @cached_property
    def planes(self) -> NDArray[np.float64]:
        """(5, 4) float64: the frustum's sides and near end; with homogeneous points, metres on their inner side."""
        x, y, z, w = self.clip_from_world
        planes = np.stack([w + x, w - x, w + y, w - y, w + z])
        reach = np.sqrt((planes[:, :3] ** 2).sum(axis=1))
        # A plane at infinity has no direction, and everything on its inner side.
        reach[reach == 0] = np.inf
        return planes / reach[:, None]

    def pixels_per_metre(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Size on screen (N,) of one metre across the line of sight at points (N, 3); 0 behind the camera."""
        height = self.viewport[3] / 2 * abs(self.clip_from_view[1, 1])
        w = np.einsum("i,ni->n", self.clip_from_world[3, :3], points) + self.clip_from_world[3, 3]
        return np.where(w > 1e-9, height / np.maximum(w, 1e-9), 0.0)

    def nearness(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """How much nearer (N,) points (N, 3) are than the camera's plane, in metres; negative for what it sees."""
        back, offset = self.view_from_world[2, :3], self.view_from_world[2, 3]
        return (np.einsum("i,ni->n", back, points) + offset).astype(np.float32)

    def sees(self, points: NDArray[np.float64], radii: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether spheres around points (N, 3) with radii (N,) touch the view frustum."""
        # Not a matrix product: with many points that starts threads, which takes longer than the work itself.
        distances = np.einsum("pi,ni->pn", self.planes[:, :3], points)
        distances += radii
        return (distances > -self.planes[:, 3:]).all(axis=0)
