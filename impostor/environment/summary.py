"""What a person wants to know of an environment at a glance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.environment.bright_lights import LUMINANCE, bright_lights, brightest_direction
from impostor.environment.cube import face_directions, sample, solid_angles
from impostor.environment.environment import Environment
from impostor.environment.harmonics import diffuse_harmonics, harmonic_diffuse
from impostor.environment.panorama import panorama_directions, resized_faces
from impostor.lighting import DirectionalLight
from impostor.srgb import srgb_from_linear

GREY, WHITE = 0.3, 6.0  # what the geometric mean is shown as, and what is shown as white
HEIGHT, BALL = 512, 320
BACKGROUND = 0.06
MARK, RADIUS = (1.0, 0.1, 0.05), 16
EVEN = 1e-3  # part of the largest luminance by which an environment without a brightest direction may differ
MEASURED, SHOWN = 512, 256  # faces: larger ones would take many times as long to say and show the same


def lights_of(environment: Environment, count: int) -> list[DirectionalLight]:
    """Its `bright_lights`."""
    return bright_lights(_at_most(environment, MEASURED), count)


def environment_summary(environment: Environment, lights: Sequence[DirectionalLight]) -> dict[str, Any]:
    """A description of an environment and its brightest lights, ready for JSON; angles in degrees."""
    angles = solid_angles(environment.size)[..., None]
    mean = (environment.faces * angles).sum(axis=(0, 1, 2)) / (4 * np.pi)
    luminance = environment.faces @ LUMINANCE
    low, high = float(np.percentile(luminance, 1)), float(luminance.max())
    measured = _at_most(environment, MEASURED)
    exact = measured.diffuse
    nine = harmonic_diffuse(diffuse_harmonics(measured), face_directions(exact.shape[1]))
    strongest, total = float((exact @ LUMINANCE).max()), float(LUMINANCE @ mean)
    return {
        "name": environment.name,
        "face_size": environment.size,
        "mean_radiance": [_short(value) for value in mean],
        "mean_luminance": _short(total),
        "largest_luminance": _short(high),
        "stops": round(float(np.log2(high / low)), 1) if low > 0 else None,
        "brightest_direction": _angles(brightest_direction(measured)) if np.ptp(luminance) > EVEN * high else None,
        "harmonics_error_percent": _short(100 * np.abs((nine - exact) @ LUMINANCE).max() / strongest) if total else 0.0,
        "lights": [
            {
                **_angles(light.toward),
                "softness_deg": round(float(np.degrees(light.softness)), 2),
                "color": [_short(value) for value in light.color],
                # A light's colour is its irradiance / pi; that of all light together, from every side, is 4 x the mean.
                "share_percent": round(100 * float(LUMINANCE @ light.color) / (4 * total), 1),
            }
            for light in lights
        ],
    }


def environment_sheet(environment: Environment, lights: Sequence[DirectionalLight]) -> NDArray[np.uint8]:
    """The environment as a panorama with lights marked, over three balls in it.

    The balls are matt white, a mirror, and a rough mirror (roughness 0.5), seen looking along -Z.

    Returns
    -------
    ndarray, (832, 1024, 3) uint8
        sRGB, exposed for the mean and toned.
    """
    environment = _at_most(environment, SHOWN)
    panorama = environment.radiance(panorama_directions(HEIGHT))
    mean = float(np.exp(np.log(np.maximum(panorama @ LUMINANCE, 1e-9)).mean()))
    balls = [
        _ball(lambda normals, toward: sample(environment.diffuse, normals)),
        _ball(lambda normals, toward: environment.mirrored(toward, 0.0)),
        _ball(lambda normals, toward: environment.mirrored(toward, 0.5)),
    ]
    row = np.zeros((BALL, 2 * HEIGHT, 4), np.float32)
    for index, ball in enumerate(balls):
        start = (2 * index + 1) * HEIGHT // 3 - BALL // 2
        row[:, start : start + BALL] = ball
    shown = _toned(row[..., :3], mean) * row[..., 3:] + BACKGROUND * (1 - row[..., 3:])
    picture = _toned(panorama, mean)
    for light in lights:
        _mark(picture, light.toward)
    return np.rint(255 * srgb_from_linear(np.concatenate([picture, shown]))).astype(np.uint8)


def _ball(look) -> NDArray[np.float32]:
    """A ball, (BALL, BALL, 4) with its coverage, in which `look` gives light for normals and mirrored directions."""
    across = (np.arange(BALL) + 0.5) * (2 / BALL) - 1
    x, y = np.meshgrid(across, -across)
    radius = np.hypot(x, y) * 1.05
    inside = np.minimum(1.05 / np.maximum(radius, 1e-9), 1) * 1.05
    x, y = x * inside, y * inside
    normals = np.stack([x, y, np.sqrt(np.maximum(1 - x**2 - y**2, 0))], axis=-1)
    toward = 2 * normals[..., 2:] * normals - (0, 0, 1)
    coverage = np.clip((1 - radius) * (BALL / 2.1) + 0.5, 0, 1)
    return np.concatenate([look(normals, toward), coverage[..., None]], axis=-1).astype(np.float32)


def _toned(light: NDArray[np.floating], mean: float) -> NDArray[np.floating]:
    """Reinhard's curve, which shows WHITE times as much as middle light as white, and no light as black."""
    light = light * (GREY / mean)
    return np.minimum(light * (1 + light / WHITE**2) / (1 + light), 1)


def _mark(picture: NDArray[np.floating], toward: ArrayLike) -> None:
    """A ring with a dark rim, across the seam."""
    x, y, z = np.asarray(toward) / np.linalg.norm(toward)
    row, column = (np.array([np.arccos(y), np.arctan2(-x, z)]) * (HEIGHT / np.pi)).tolist()
    across = (np.arange(2 * HEIGHT) + 0.5 - column + HEIGHT) % (2 * HEIGHT) - HEIGHT
    away = np.abs(np.hypot(np.arange(HEIGHT)[:, None] + 0.5 - row, across) - RADIUS)
    picture[away < 3] = 0
    picture[away < 1.5] = MARK


def _at_most(environment: Environment, size: int) -> Environment:
    if environment.size <= size:
        return environment
    return Environment(environment.name, resized_faces(environment.faces, size))


def _angles(toward: ArrayLike) -> dict[str, float]:
    x, y, z = np.asarray(toward, float) / np.linalg.norm(toward)
    return {
        "azimuth_deg": round(float(np.degrees(np.arctan2(x, z))), 1),
        "elevation_deg": round(float(np.degrees(np.arcsin(y))), 1),
    }


def _short(value: float) -> float:
    """Rounded for reading, whatever its size."""
    return float(f"{value:.4g}")
