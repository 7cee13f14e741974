"""What of a fan and its copies every frame needs and no viewer changes: the views' vectors, and where copies stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impostor.views import Views, ring_bases
from runtime.checks import LARGEST, SMALLEST


class ViewVectors:
    """A fan's views as many instances at once need them: found by direction, turned about +Y.

    Parameters
    ----------
    views : Views

    Attributes
    ----------
    middle : ndarray, (3,) float64
        Of the views' centres.
    reach : float
        From there to the farthest corner of any quad.
    """

    def __init__(self, views: Views):
        right, up, back = views.basis.swapaxes(0, 1)
        offset, slope_right, slope_up = views.plane.T[..., None]
        # A perspective camera's picture shrinks with the distance of the plane it falls on.
        spread = 1 - offset / views.distance
        quad = {
            "center": views.center + offset * back,
            "right": spread * right + slope_right * back,
            "up": spread * up + slope_up * back,
        }
        axes = {"axis_right": right, "axis_up": up, "axis_back": back}
        vectors = {**axes, "origin": views.center, **quad}
        # About +Y, z + ix turns as one complex number.
        self._vectors = {name: (each[:, 2] + 1j * each[:, 0], each[:, 1].copy()) for name, each in vectors.items()}
        self.middle = views.center.mean(axis=0)
        sides = [views.radius[:, None] * (quad["right"] + side * quad["up"]) for side in (-1, 1)]
        corners = np.stack([quad["center"] + side * each for side in (-1, 1) for each in sides])
        self.reach = float(np.linalg.norm(corners - self.middle, axis=-1).max())

        ring = ring_bases(len(views), float(np.arcsin(np.clip(back[0, 1], -1, 1))))[:, 2]
        self._views, self._is_ring = views, np.allclose(back, ring, rtol=0, atol=1e-9)

    def nearest(self, x: NDArray[np.float64], y: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.intp]:
        """`Views.nearest` of directions (N,) in model space; of a ring without asking every view."""
        if not self._is_ring:
            return self._views.nearest(np.stack([x, y, z], axis=-1))
        steps = np.arctan2(x, z) * (len(self._views) / (2 * np.pi))
        return np.rint(steps).astype(np.intp) % len(self._views)

    def turned(self, name: str, view: NDArray[np.intp], turns: NDArray[np.complex128]) -> NDArray[np.float64]:
        """A vector of some views, each turned by exp(i yaw).

        Parameters
        ----------
        name : str
            "axis_right", "axis_up" or "axis_back", the view's basis; "origin", its centre; "center", "right" or "up",
            its quad as `runtime.instances.quads.Quads` has it.
        view : ndarray, (N,) intp
        turns : ndarray, (N,) complex128

        Returns
        -------
        ndarray, (3, N) float64
        """
        levels, heights = self._vectors[name]
        level = levels.take(view)
        level *= turns
        vectors = np.empty((3, len(view)))
        vectors[0], vectors[1], vectors[2] = level.imag, heights.take(view), level.real
        return vectors


@dataclass(frozen=True, eq=False)
class Placement:
    """Where copies of a fan stand. Those that cannot be drawn stand at the origin, with a scale of 0.

    Parameters
    ----------
    view_vectors : ViewVectors
    positions, middles : ndarray, (3, N) float64
        The models' origins, and the middles of the fan's views, in the world.
    scales : ndarray, (N,) float64
    turns : ndarray, (N,) complex128
        exp(i yaw).
    turn_keys : ndarray, (N,) int64
        The yaws in their upper 32 bits, equal where they are equal as float32.
    radii : ndarray, (N,) float64
        Of spheres around the middles that hold the quad of every view; minus infinity where nothing can be drawn.
    """

    view_vectors: ViewVectors
    positions: NDArray[np.float64]
    middles: NDArray[np.float64]
    scales: NDArray[np.float64]
    turns: NDArray[np.complex128]
    turn_keys: NDArray[np.int64]
    radii: NDArray[np.float64]

    @classmethod
    def of(
        cls,
        view_vectors: ViewVectors,
        positions: NDArray[np.float64],
        yaws: NDArray[np.float64],
        scales: NDArray[np.float64],
    ) -> Placement:
        """Copies at positions (N, 3), with yaws (N,) and scales (N,) as the caller has written them."""
        with np.errstate(over="ignore"):
            # Not a number in any of them makes the sum none either, which is not below anything.
            reach = np.abs(positions).sum(axis=1) + np.abs(yaws) + view_vectors.reach * scales
            drawable = (reach + scales < LARGEST) & (scales > SMALLEST)
        positions = np.where(drawable, positions.T, 0.0)
        yaws, scales = np.where(drawable, yaws, 0.0), np.where(drawable, scales, 0.0)
        turns = np.exp(1j * yaws)
        x, y, z = view_vectors.middle
        level = (z + 1j * x) * turns
        middles = positions + scales * np.stack([level.imag, np.full(len(yaws), y), level.real])
        turn_keys = yaws.astype(np.float32).view(np.int32).astype(np.int64) << 32
        radii = np.where(drawable, view_vectors.reach * scales, -np.inf)
        return cls(view_vectors, positions, middles, scales, turns, turn_keys, radii)
