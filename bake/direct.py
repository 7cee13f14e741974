"""Pictures straight from the photographs, with no fit: three of them blended, as HPL-98-131 does to judge its fits."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import Delaunay, QhullError

from bake.photographs import Photographs
from impostor.errors import SettingsError


class LightTriangulation:
    """Which photographs a light lies between, and how near it is to each.

    The triangles are Delaunay's in the (lu, lv) disc. On the sphere's hull, a light below the lowest ring would find
    the chord across the open side of the dome: on the disc, it finds the nearest point of the ring.

    Parameters
    ----------
    parameters : array_like of shape (N, 2), float
        (lu, lv) of the photographs.

    Raises
    ------
    SettingsError
        Fewer than three lights, or all on one line.

    References
    ----------
    HPL-98-131, section 2.
    """

    def __init__(self, parameters: ArrayLike):
        self.points = np.asarray(parameters, np.float64)
        if self.points.ndim != 2 or self.points.shape[1] != 2 or len(self.points) < 3:
            raise SettingsError("lights", f"{len(self.points)} of them; expected at least 3, not on one line")
        try:
            self._mesh = Delaunay(self.points)
        except QhullError:
            raise SettingsError("lights", "all lie on one line; expected a triangle of lights at least") from None

    def weights(self, lu: float, lv: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """The photographs to blend for one light.

        Parameters
        ----------
        lu, lv : float
            Outside all triangles the nearest point of their outline stands for it.

        Returns
        -------
        indices : ndarray of shape (K,), int64
            One to three photographs.
        weights : ndarray of shape (K,), float64
            Barycentric: above 0, and 1 in sum.
        """
        if not np.isfinite([lu, lv]).all():
            raise SettingsError("light", f"{lu}, {lv}; expected two finite numbers")
        point = np.array([lu, lv], np.float64)
        triangle = int(self._mesh.find_simplex(point[None])[0])
        if triangle < 0:
            corners, weights = self._on_outline(point)
        else:
            transform = self._mesh.transform[triangle]
            first = transform[:2] @ (point - transform[2])
            corners, weights = self._mesh.simplices[triangle], np.array([*first, 1 - first.sum()])
        weights = weights.clip(0)
        kept = weights > 1e-12
        return corners[kept].astype(np.int64), weights[kept] / weights[kept].sum()

    def _on_outline(self, point: NDArray[np.float64]) -> tuple[NDArray[Any], NDArray[np.float64]]:
        edges = self._mesh.convex_hull
        start, along = self.points[edges[:, 0]], self.points[edges[:, 1]] - self.points[edges[:, 0]]
        share = np.clip(np.sum((point - start) * along, axis=1) / np.sum(along * along, axis=1), 0, 1)
        nearest = int(np.argmin(np.sum((start + share[:, None] * along - point) ** 2, axis=1)))
        return edges[nearest], np.array([1 - share[nearest], share[nearest]])


def render_direct(
    photographs: Photographs, triangulation: LightTriangulation, lu: float, lv: float
) -> NDArray[np.float32]:
    """The picture under one light, blended from the photographs nearest to it.

    Parameters
    ----------
    photographs : Photographs
    triangulation : LightTriangulation
        Of their lights, in the same order.
    lu, lv : float

    Returns
    -------
    ndarray of shape (H, W, 3), float32
        Stored values over white.

    Raises
    ------
    PhotographError
    SettingsError
        The light is not finite.

    References
    ----------
    HPL-98-131, section 2.
    """
    width, height = photographs.size
    total = np.zeros((height, width, photographs.channels), np.float32)
    for index, weight in zip(*triangulation.weights(lu, lv), strict=True):
        total += photographs.decode(int(index)) * np.float32(weight / photographs.white)
    return np.broadcast_to(total, (height, width, 3))
