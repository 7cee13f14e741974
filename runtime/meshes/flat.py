"""Flat models: the plane that all of one lies in."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from impostor.model import Model

FLAT = 1e-4  # of a model's radius: what reaches no farther out of a plane is flat


class ModelPlane(NamedTuple):
    """A plane through the middle of a model."""

    normal: NDArray[np.float64]
    """(3,): the mean of the model's normals, unit; zero where they cancel."""
    point: NDArray[np.float64]
    """(3,): the mean of its positions."""
    off: float
    """Metres that the model reaches out of it."""
    flat: bool
    """Whether the model lies in it."""


def model_plane(model: Model) -> ModelPlane:
    """The plane that a model lies in if it is flat, model space."""
    positions = np.concatenate([part.positions for part in model.primitives]).astype(float)
    normal = np.concatenate([part.normals for part in model.primitives]).sum(axis=0, dtype=float)
    normal /= max(float(np.linalg.norm(normal)), 1e-9)
    point = positions.mean(axis=0)
    off = float(np.abs((positions - point) @ normal).max())
    flat = off <= FLAT * model.radius and float(np.linalg.norm(normal)) > 0.5
    return ModelPlane(normal, point, off, flat)
