"""Lights to colormap: the 225 colours that relight a whole fan. The GPU path must equal this one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.checks import check_number, numbers
from impostor.errors import SettingsError
from impostor.normal_code import BYTE_TO_NORMAL
from impostor.views import direction


@dataclass(frozen=True)
class DirectionalLight:
    """A light infinitely far away.

    Parameters
    ----------
    toward : tuple of float
        From the scene toward the light, world space; made unit length.
    color : tuple of float
        Linear radiance; (1, 1, 1) shows a white surface that faces the light as white.
    softness : float
        Angular radius of what shines, in radians: the sun's is 0.0047. Only shadows show it.

    Raises
    ------
    SettingsError
        A direction of no length, a negative or non-finite number, a softness of a quarter turn or more.
    """

    toward: tuple[float, float, float]
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    softness: float = 0.0

    def __post_init__(self):
        toward, color = _three(self.toward), _three(self.color)
        length = float(np.linalg.norm(toward))
        if not (np.isfinite(length) and length > 1e-12):
            raise SettingsError("light", f"direction {self.toward}; expected three finite numbers, not all zero")
        if not np.all(color >= 0):
            raise SettingsError("light", f"colour {self.color}; expected three finite numbers, none negative")
        if not isinstance(self.softness, Real):
            check_number("light", "softness", self.softness, 0)
        if not 0 <= self.softness < np.pi / 2:
            raise SettingsError("light", f"softness {self.softness}; expected radians from 0 to below {np.pi / 2:.4f}")
        object.__setattr__(self, "toward", tuple((toward / length).tolist()))
        object.__setattr__(self, "color", tuple(color.tolist()))

    @classmethod
    def from_angles(cls, azimuth_deg: float, elevation_deg: float, color: ArrayLike = (1.0, 1.0, 1.0)):
        """The light that stands at an azimuth and an elevation, -90 to 90, in degrees."""
        check_number("light", "azimuth", azimuth_deg)
        check_number("light", "elevation", elevation_deg, -90, 90)
        x, y, z = direction(np.radians(azimuth_deg), np.radians(elevation_deg)).tolist()
        return cls((x, y, z), color)  # type: ignore[arg-type]


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
        position, color = _three(self.position), _three(self.color)
        if not np.all(np.isfinite(position)):
            raise SettingsError("light", f"position {self.position}; expected three finite numbers")
        if not np.all(color >= 0):
            raise SettingsError("light", f"colour {self.color}; expected three finite numbers, none negative")
        if not isinstance(self.radius, Real) or not 0 < self.radius < np.inf:
            check_number("light", "radius", self.radius, 0, above=True)
        object.__setattr__(self, "position", tuple(position.tolist()))
        object.__setattr__(self, "color", tuple(color.tolist()))


@dataclass(frozen=True)
class Gloss:
    """The highlight of a surface (Blinn-Phong).

    Parameters
    ----------
    strength : float
        Reflected part of a light at the peak of the highlight; 0 switches it off.
    shininess : float
        Exponent on N.H; larger is a smaller highlight.
    """

    strength: float = 0.0
    shininess: float = 32.0

    def __post_init__(self):
        if not (0 <= self.strength < np.inf and 0 < self.shininess < np.inf):
            found = f"strength {self.strength}, shininess {self.shininess}"
            raise SettingsError("gloss", f"{found}; expected strength of at least 0, shininess above 0")


def _three(values: object) -> NDArray[np.float64]:
    """Three finite numbers, or three that are none."""
    try:
        found = numbers("light", "three", values, (3,))  # type: ignore[arg-type]
    except SettingsError:
        return np.full(3, np.nan)
    return found


class Colormap(NamedTuple):
    """One entry per normal code; linear light, rows 225 to 255 are zero."""

    diffuse: NDArray[np.float32]
    """(..., 256, 3): multiplies the albedo."""
    specular: NDArray[np.float32]
    """(..., 256, 3): added on top."""


def colormap(
    view_from_world: ArrayLike,
    lights: Sequence[DirectionalLight],
    ambient: ArrayLike = 0.0,
    gloss: Gloss | None = None,
) -> Colormap:
    """The colour of every representable normal under all lights.

    Parameters
    ----------
    view_from_world : array_like, (..., 3, 3) float
        Rows right, up, back of the fan's view as the instance is turned in the world.
    lights : sequence of DirectionalLight
    ambient : array_like, () or (3,) float
        Linear light that reaches every normal.
    gloss : Gloss, optional

    Returns
    -------
    Colormap

    References
    ----------
    Dinh, Metoyer, Turk, "Normal Coding for Shading", equation 1.
    """
    gloss = gloss or Gloss()
    basis = np.asarray(view_from_world, np.float64)
    normals = BYTE_TO_NORMAL[:225].astype(np.float64)
    toward = np.array([light.toward for light in lights], float).reshape(-1, 3)
    color = np.array([light.color for light in lights], float).reshape(-1, 3)
    toward_view = np.einsum("...ij,lj->...li", basis, toward)
    facing = np.maximum(np.einsum("ni,...li->...nl", normals, toward_view), 0)
    diffuse = np.zeros((*basis.shape[:-2], 256, 3), np.float32)
    specular = np.zeros_like(diffuse)
    diffuse[..., :225, :] = facing @ color + np.broadcast_to(np.asarray(ambient, float), (3,))
    if gloss.strength > 0 and len(lights):
        half = toward_view + np.array([0.0, 0.0, 1.0])
        half /= np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-9)
        highlight = np.maximum(np.einsum("ni,...li->...nl", normals, half), 0) ** gloss.shininess * (facing > 0)
        specular[..., :225, :] = gloss.strength * (highlight @ color)
    return Colormap(diffuse, specular)
