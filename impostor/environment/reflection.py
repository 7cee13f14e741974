"""Reflection: how much of its surroundings a surface mirrors, and how sharply."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.checks import check_number


@dataclass(frozen=True)
class Reflection:
    """How much of its surroundings a surface mirrors, and how sharply.

    The light that leaves a surface is `albedo * ((1 - metal) * diffuse + metal * mirrored) + (1 - metal) * mirrored`,
    where `mirrored` is `fresnel(...)` times the radiance around the mirrored direction.

    Parameters
    ----------
    strength : float
        Part of the light that is mirrored at grazing angles, Kr.
    least : float
        Part that is mirrored head-on, KrMin. As large as `strength`, the reflection is even, as a metal's.
    exponent : float
        Of the Fresnel term, FresExp: 5 is Schlick's, 4 is cheap to compute, less looks lacquered.
    roughness : float
        0 is a mirror, 1 the widest lobe (GGX, whose alpha is the square of this).
    metal : float
        0 to 1: how far the albedo colours the reflection and leaves no diffuse light.

    Raises
    ------
    SettingsError
        What is no number, or one outside its range.

    References
    ----------
    Bjorke, "Image-Based Lighting", GPU Gems 19, listing 19-2 and section 19.3.1.
    """

    strength: float = 1.0
    least: float = 0.05
    exponent: float = 5.0
    roughness: float = 0.0
    metal: float = 0.0

    def __post_init__(self):
        ranges = {"strength": 1, "least": 1, "exponent": 64, "roughness": 1, "metal": 1}
        for name, high in ranges.items():
            check_number("reflection", name, getattr(self, name), 0, high)

    def fresnel(self, facing: ArrayLike) -> NDArray[np.float64]:
        """Part of the light that is mirrored, where `facing` is the cosine between the normal and the viewer."""
        grazing = 1 - np.minimum(np.abs(np.asarray(facing, np.float64)), 1)
        return self.least + (self.strength - self.least) * grazing**self.exponent
