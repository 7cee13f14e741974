"""The clear sky as an environment, which follows the sun of a scene."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from impostor.checks import check_number, numbers
from impostor.environment.bright_lights import LUMINANCE
from impostor.environment.cube import face_directions, solid_angles
from impostor.environment.environment import Environment
from impostor.errors import SettingsError
from impostor.scene import Scene, Vector
from impostor.sun import sky_color, sun_at, sunlight

SIZE = 64  # texels along a face: the sky is smooth
STEP, STEPS = np.radians(0.5), 8
"""Elevations of the sun between which the sky is taken to be the same, and how many of them lie between two skies that
are convolved; the others are mixed from those two."""
REMEMBERED = 64
CLEAR, HAZY = (10.0, 0.45), (16.0, 0.30)
"""c and e of the standard's types 12 and 13; both have a = -1, b = -0.32, d = -3."""
OVERHEAD = np.array([0.25, 0.44, 0.76])  # linear, by day and at dawn
MUCH_AIR = 0.3
"""Cosine of the zenith angle around which the sky grows pale: more air scatters again what it has scattered."""
GROUND = (0.2, 0.2, 0.2)


def clear_sky(elevation: float, sky: Vector, sun: Vector, ground: Vector = GROUND, haze: float = 0.0) -> Environment:
    """Sky and ground around a point in the open, without the sun itself, which is a light.

    Parameters
    ----------
    elevation : float
        Of the sun, which stands at azimuth 0, toward +Z; radians, below 0 is beneath the horizon.
    sky : tuple of float
        Linear light of the whole sky on a white surface that faces up. Its luminance holds; its colour is what the
        sky has toward the horizon, mixed with white.
    sun : tuple of float
        Linear light of the sun on a white surface that faces it; 0 where it is down.
    ground : tuple of float
        Linear albedo of the plain below, which sky and sun light.
    haze : float
        0 is clear air, 1 the polluted air of a town: a wider, brighter glow around the sun.

    Returns
    -------
    Environment
        Faces of SIZE texels.

    Raises
    ------
    SettingsError
        What is no number, a negative one, a haze beyond 1.

    References
    ----------
    CIE S 011/E:2003, "Spatial Distribution of Daylight - CIE Standard General Sky", sky types 12 and 13: luminance
    relative to the zenith's. Colours are the project's own.
    """
    check_number("sky", "elevation", elevation)
    check_number("sky", "haze", haze, 0, 1)
    given = {"sky": sky, "sun": sun, "ground": ground}
    sky_light, sun_light, albedo = (numbers("sky", name, values, (3,)) for name, values in given.items())
    for name, values in given.items():
        if min(values) < 0:
            raise SettingsError("sky", f"{name} {values}; expected three finite numbers, none negative")
    toward = face_directions(SIZE)
    up = toward[..., 1]
    to_sun = np.arccos(np.clip(toward @ (0, np.sin(elevation), np.cos(elevation)), -1, 1))
    light = _luminance(up, to_sun, haze)[..., None] * _color(up, to_sun, sky_light, sun_light)
    above = np.maximum(up, 0) * solid_angles(SIZE)
    # However the light is spread, there is as much of it as was asked for.
    light *= LUMINANCE @ sky_light / np.maximum(np.einsum("fij,fijc->c", above, light) @ LUMINANCE / np.pi, 1e-12)
    below = albedo * (sky_light + sun_light * max(np.sin(elevation), 0))
    # A texel on the horizon is half of each.
    share = np.clip(up * (SIZE / 2) + 0.5, 0, 1)[..., None]
    return Environment(_name(elevation), (share * light + (1 - share) * below).astype(np.float32), sources=False)


def sky_of(scene: Scene) -> Environment | None:
    """The sky of a scene at its time of day, turned so that the sun is at azimuth 0; None where there is no sun.

    Skies of nearly one elevation of the sun are the same object, so that what is made of one stays.
    """
    if scene.sun is None:
        return None
    now = sun_at(scene.sun, scene.sun.time_of_day)
    ground = GROUND if scene.ground is None or not scene.ground.visible else scene.ground.albedo
    return _sky_near(scene.sun.color, scene.sun.skylight, ground, round(now.elevation / STEP))


@lru_cache(REMEMBERED)
def _sky_near(color: Vector, skylight: float, ground: Vector, step: int) -> Environment:
    before, part = divmod(step, STEPS)
    if part:
        first, second = (_key_sky(color, skylight, ground, each) for each in (before, before + 1))
        return Environment.between(_name(step * STEP), first, second, part / STEPS)
    return _key_sky(color, skylight, ground, before)


@lru_cache(REMEMBERED)
def _key_sky(color: Vector, skylight: float, ground: Vector, key: int) -> Environment:
    elevation = key * STEPS * STEP
    red, green, blue = np.multiply(color, sunlight(elevation)).tolist()
    blue_sky: Vector = tuple((skylight * sky_color(elevation)).tolist())  # type: ignore[assignment]
    return clear_sky(elevation, blue_sky, (red, green, blue), ground)


def _name(elevation: float) -> str:
    return f"clear sky, sun at {np.degrees(elevation):.1f} degrees"


def _luminance(up: NDArray[np.float64], to_sun: NDArray[np.float64], haze: float) -> NDArray[np.float64]:
    """Relative luminance: gradation, from the horizon to the zenith, times indicatrix, around the sun."""
    c, e = (low + haze * (high - low) for low, high in zip(CLEAR, HAZY, strict=True))
    gradation = 1 - np.exp(-0.32 / np.maximum(up, 1e-3))
    indicatrix = 1 + c * (np.exp(-3 * to_sun) - np.exp(-3 * np.pi / 2)) + e * np.cos(to_sun) ** 2
    return gradation * np.maximum(indicatrix, 0)


def _color(
    up: NDArray[np.float64], to_sun: NDArray[np.float64], sky: NDArray[np.float64], sun: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Colours of luminance 1: blue overhead, pale toward the horizon, the sun's around it."""
    overhead, of_sky, of_sun = (light / max(float(light @ LUMINANCE), 1e-12) for light in (OVERHEAD, sky, sun))
    much_air = np.exp(-np.maximum(up, 0) / MUCH_AIR)[..., None]
    glow = np.exp(-2 * to_sun)[..., None] if sun.any() else 0.0
    color = overhead + much_air * (0.7 * of_sky + 0.3 - overhead)
    return color + glow * (of_sun - color)
