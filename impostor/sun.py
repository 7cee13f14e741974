"""The sun: time of day to direction and colour of its light, and to the colour of the sky."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from impostor.lighting import DirectionalLight
from impostor.scene import Scene, Sun, Vector

TILT_OF_EARTH = np.radians(23.44)
LONGEST_DAY = 172
OPTICAL_DEPTH = np.array([0.138, 0.209, 0.368])
"""Of clear air straight up at 650, 550 and 450 nm: 0.008735 x^-4.08 (Rayleigh) + 0.05 x^-1.3 (haze), x in um."""
_SKY = np.array(
    [
        # degrees of elevation, linear red, green, blue
        [-18.0, 0.001, 0.002, 0.005],
        [-8.0, 0.008, 0.014, 0.040],
        [-3.0, 0.090, 0.075, 0.120],
        [0.0, 0.330, 0.210, 0.180],
        [4.0, 0.420, 0.360, 0.350],
        [12.0, 0.330, 0.440, 0.600],
        [40.0, 0.250, 0.440, 0.760],
        [90.0, 0.220, 0.420, 0.780],
    ]
)


@dataclass(frozen=True)
class Daylight:
    """What the sun does at one time.

    Parameters
    ----------
    azimuth, elevation : float
        Radians; where the sun stands.
    light : DirectionalLight or None
        None while it is below the horizon.
    sky : tuple of float
        Linear colour.
    ambient : tuple of float
        Linear light of the sky on every normal.
    """

    azimuth: float
    elevation: float
    light: DirectionalLight | None
    sky: Vector
    ambient: Vector


@dataclass(frozen=True)
class Lighting:
    """All light of a scene at one time, as the renderer takes it; linear.

    Parameters
    ----------
    lights : tuple of DirectionalLight
    ambient, background : tuple of float
    """

    lights: tuple[DirectionalLight, ...]
    ambient: Vector
    background: Vector


def sun_at(sun: Sun, hours: float) -> Daylight:
    """The sun's light, and the sky's.

    Parameters
    ----------
    sun : Sun
    hours : float
        Solar time; 12 is noon, any number of days may be added.

    Returns
    -------
    Daylight
        It changes without a jump, sunrise and sunset included.

    References
    ----------
    Kasten, Young, "Revised optical air mass tables and approximation formula", Applied Optics 28 (1989).
    """
    east, up, north = _direction(sun, hours)
    elevation = float(np.arcsin(np.clip(up, -1, 1)))
    azimuth = float((sun.north - np.arctan2(east, north) + np.pi) % (2 * np.pi) - np.pi)
    level = np.cos(elevation)
    toward = (float(level * np.sin(azimuth)), float(up), float(level * np.cos(azimuth)))
    color = np.multiply(sun.color, sunlight(elevation))
    light = DirectionalLight(toward, _triple(color)) if elevation > 0 else None
    sky = sky_color(elevation)
    return Daylight(azimuth, elevation, light, _triple(np.minimum(sky, 1)), _triple(sun.skylight * sky))


def sky_color(elevation: float) -> np.ndarray:
    """Linear colour of the sky, (3,) float64, where the sun has some elevation, radians."""
    degrees = np.degrees(elevation)
    return np.array([np.interp(degrees, _SKY[:, 0], _SKY[:, 1 + channel]) for channel in range(3)])


def sunlight(elevation: float) -> np.ndarray:
    """Colour of sunlight through clear air, (1, 1, 1) from the zenith.

    Parameters
    ----------
    elevation : float
        Radians.

    Returns
    -------
    ndarray, (3,) float64
        Linear; 0 below the horizon, reached without a jump.
    """
    degrees = np.degrees(max(elevation, 0.0))
    air_mass = 1 / (np.sin(np.radians(degrees)) + 0.50572 * (degrees + 6.07995) ** -1.6364)
    rise = np.clip(degrees / 0.5, 0, 1)  # the disc is half a degree wide
    return rise * np.minimum(np.exp(-OPTICAL_DEPTH * (air_mass - 1)), 1)


def lighting_at(scene: Scene, seconds: float = 0.0) -> Lighting:
    """Lights, ambient light and background of a scene that runs since `seconds`.

    Where a room is the sky, the sky's light is that room's.
    """
    daylight = None if scene.sun is None else sun_at(scene.sun, hours_at(scene.sun, seconds))
    lights, ambient, sky = scene.lights, scene.ambient, (0.0, 0.0, 0.0)
    if daylight is not None:
        lights += () if daylight.light is None else (daylight.light,)
        if not any(room.sky for room in scene.rooms):
            ambient = _triple(np.add(ambient, daylight.ambient))
        sky = daylight.sky
    return Lighting(lights, ambient, sky if scene.background is None else scene.background)


def hours_at(sun: Sun, seconds: float) -> float:
    """Time of day, 0 to 24, of a scene that runs since `seconds`."""
    return (sun.time_of_day + sun.hours_per_second * seconds) % 24.0


def _direction(sun: Sun, hours: float) -> tuple[float, float, float]:
    """Toward the sun: east, up, north."""
    turn = np.pi * (hours - 12) / 12
    declination = TILT_OF_EARTH * np.cos(2 * np.pi * (sun.day_of_year - LONGEST_DAY) / 365)
    sin_pole, cos_pole = np.sin(sun.latitude), np.cos(sun.latitude)
    level, polar = np.cos(declination) * np.cos(turn), np.sin(declination)
    east = -np.cos(declination) * np.sin(turn)
    return float(east), float(sin_pole * polar + cos_pole * level), float(cos_pole * polar - sin_pole * level)


def _triple(values: np.ndarray) -> Vector:
    x, y, z = values.tolist()
    return x, y, z
