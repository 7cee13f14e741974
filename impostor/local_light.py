"""Lights that stand somewhere in the scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from impostor.errors import SettingsError


@dataclass(frozen=True)
class LocalLight:
    """A small lamp: its light falls off with the square of the distance.

    Parameters
    ----------
    position : tuple of float
        World space, metres.
    color : tuple of float
        Linear radiance; (1, 1, 1) shows a white surface that faces the lamp from one metre away as white.
    radius : float
        Of the lamp, metres; nearer than this it gets no brighter.

    Raises
    ------
    SettingsError
        A number that is not finite, a negative colour, a radius that is not above 0.
    """

    position: tuple[float, float, float]
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    radius: float = 0.05

    def __post_init__(self):
        position, color = np.asarray(self.position, float), np.asarray(self.color, float)
        if position.shape != (3,) or not np.all(np.isfinite(position)):
            raise SettingsError("light", f"position {self.position}; expected three finite numbers")
        if color.shape != (3,) or not np.all(np.isfinite(color)) or np.any(color < 0):
            raise SettingsError("light", f"colour {self.color}; expected three finite numbers, none negative")
        if not 0 < self.radius < np.inf:
            raise SettingsError("light", f"radius {self.radius}; expected a number above 0")
        object.__setattr__(self, "position", tuple(position.tolist()))
        object.__setattr__(self, "color", tuple(color.tolist()))
