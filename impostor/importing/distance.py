"""How far from the origin a model's file has put it, and what that does to its coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from impostor.importing.parts import Part

FAR = 16.0
"""Sizes of the object from the origin up to which 32 bits are kept: a millionth of its size is seen nowhere."""
COARSE = 2000
"""Steps across the object below which its coordinates are told to be too few: a large tile has as many texels."""


class Distance:
    """Where parts stand together.

    Parameters
    ----------
    parts : sequence of Part
        Checked, without vertices that no triangle uses.

    Attributes
    ----------
    origin : ndarray, (3,) float64
        What is to be taken off the coordinates before they get 32 bits; zero along every axis where that is nothing.
        A number of 32 bits itself, so that taking it off coordinates of 32 bits is exact.
    size : float
        Longest side of the bounding box, in metres; up to 1.7 times as long where a node turns its mesh.
    reach : float
        The largest coordinate.
    step : float
        How far apart the coordinates are that the file's own 32 bits can tell, in metres; 0 where it has more bits.
    """

    def __init__(self, parts: Sequence[Part]):
        corners = [_corners(part) for part in parts if len(part.positions)]
        points = np.concatenate(corners) if corners else np.zeros((1, 3))
        low, high = points.min(axis=0), points.max(axis=0)
        middle = (low + high) / 2
        self.size, self.reach = float((high - low).max()), float(np.abs(points).max())
        far = np.isfinite(middle) & (np.abs(middle) > FAR * self.size)
        self.origin = np.where(far, middle, 0.0).astype(np.float32).astype(np.float64)
        self.step = max((_step(part) for part in parts if len(part.positions)), default=0.0)

    @property
    def problem(self) -> str | None:
        """What is wrong with coordinates that are too few for the object; None where there are enough."""
        if not COARSE * self.step > self.size:
            return None
        return f"coordinates at {self.reach:.3g} m are {self.step:.3g} m apart in 32 bits"


def _corners(part: Part) -> np.ndarray:
    """Corners of a part's bounding box where the scene holds it, (8 * instances, 3)."""
    low, high = part.positions.min(axis=0), part.positions.max(axis=0)
    box = np.stack(np.meshgrid(*np.stack([low, high], axis=1).astype(np.float64)), axis=-1).reshape(8, 3)
    worlds = np.asarray(part.worlds, np.float64)
    return (box @ worlds[:, :3, :3].swapaxes(1, 2) + worlds[:, None, :3, 3]).reshape(-1, 3)


def _step(part: Part) -> float:
    if part.positions.dtype not in (np.float16, np.float32):
        return 0.0
    largest = np.abs(part.positions).max().astype(np.float32)
    stretch = np.linalg.norm(np.asarray(part.worlds, np.float64)[:, :3, :3], axis=1).max()
    return float(np.spacing(largest)) * float(stretch)
