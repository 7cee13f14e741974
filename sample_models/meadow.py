"""A meadow on a clear day, as light from all directions: sun, sky, clouds, hills, grass, a path."""

from __future__ import annotations

import numpy as np
from paint import noise, rgb

from impostor.srgb import linear_from_srgb
from impostor.views import direction

SUN = direction(np.radians(128.0), np.radians(36.0))
SUN_RADIUS = np.radians(0.6)
SUN_COLOR = np.array([1.0, 0.93, 0.8])
SUN_IRRADIANCE = 2.4  # what a white surface that faces the sun shows of it
SKY_IRRADIANCE = np.array([0.42, 0.52, 0.68])
EYE = 1.7
ZENITH, HORIZON, HAZE = np.array([0.09, 0.22, 0.66]), np.array([0.4, 0.62, 1.0]), np.array([0.9, 0.93, 0.95])
CLOUDS = noise((512, 512), 11, 1.75, (0.8, 1.0))
GRASS, PATCHES = noise((512, 512), 12, 0.9), noise((512, 512), 13, 1.7)
RIDGES = [noise((1024, 1024), seed, slope)[0] for seed, slope in ((21, 2.0), (22, 1.9), (25, 1.5))]
RIDGE_HEIGHTS_DEG = ((7.5, 5.0), (4.0, 2.6), (2.0, 1.1))
RIDGE_COLORS = ("#6d7f8a", "#5f8046", "#31502a")
RIDGE_HAZE = (0.5, 0.2, 0.05)
RIDGE_GRAIN = (0.18, 0.2, 0.35)


def radiance(directions: np.ndarray) -> np.ndarray:
    """Linear radiance from unit directions (H, W, 3)."""
    light = sky(directions)
    elevation = np.degrees(np.arcsin(directions[..., 1]))
    turn = np.arctan2(directions[..., 0], directions[..., 2]) / (2 * np.pi)
    for ridge, (base, rough), color, haze, grain in zip(
        RIDGES, RIDGE_HEIGHTS_DEG, RIDGE_COLORS, RIDGE_HAZE, RIDGE_GRAIN, strict=True
    ):
        top = base + rough * np.interp(turn % 1 * len(ridge), np.arange(len(ridge) + 1), np.append(ridge, ridge[0]))
        depth = np.maximum(top - elevation, 0)
        woods = grain * tiled(PATCHES, turn * 9, depth / 14) + grain / 2 * tiled(GRASS, turn * 20, depth / 9)
        facing = 0.85 - 0.35 * np.sin((turn - 128 / 360) * 2 * np.pi) * tiled(PATCHES, turn * 4, depth / 40)
        lit = linear(color) * np.clip(1 + woods, 0.3, None)[..., None] * sunlit(facing[..., None])
        light = mix(light, mix(lit, HAZE * 0.8, haze), np.clip((top - elevation) / 0.15, 0, 1))
    return np.where(directions[..., 1:2] < 0, ground(directions), light)


def sky(directions: np.ndarray) -> np.ndarray:
    """Sun, clear sky and clouds; below the horizon as on it."""
    up = np.maximum(directions[..., 1], 0)[..., None]
    away = np.arccos(np.clip(directions @ SUN, -1, 1))[..., None]
    light = mix(ZENITH, HORIZON, np.exp(-3.4 * up)[..., 0])
    light = mix(light, HAZE, 0.7 * np.exp(-14 * up)[..., 0])
    glow = 1.1 * np.exp(-away / np.radians(5)) + 0.4 * np.exp(-away / np.radians(22))
    light = light + SUN_COLOR * glow
    place = directions[..., ::2] / (up + 0.15) * 0.4 + (0.48, 0.1)
    here = _cloud(place)
    toward = _cloud(place + SUN[::2] * 0.04)
    cover = np.clip((here - 0.45) / 0.8, 0, 1) ** 0.7 * np.clip(up[..., 0] / 0.12, 0, 1)
    cover *= np.clip((away[..., 0] - np.radians(7)) / np.radians(14), 0, 1)
    shade = np.clip(0.55 + 0.55 * (here - toward) - 0.12 * (here - 0.6), 0, 1)
    cloud = mix(np.array([0.75, 0.82, 0.95]), np.array([2.6, 2.5, 2.4]), shade) + SUN_COLOR * glow * 0.5
    light = mix(light, cloud, 0.92 * cover)
    disc = np.clip((SUN_RADIUS - away) / np.radians(0.1) + 0.5, 0, 1)
    return light + disc * SUN_COLOR * (SUN_IRRADIANCE / np.sin(SUN_RADIUS) ** 2)


def ground(directions: np.ndarray) -> np.ndarray:
    """Grass with flowers and a path, seen from EYE metres above."""
    down = np.maximum(-directions[..., 1], 1e-4)
    x, z = directions[..., 0] * EYE / down, directions[..., 2] * EYE / down
    far = np.hypot(x, z)
    detail = 1 / (1 + (far / 9) ** 2)  # what is smaller than a texel is its mean
    blades = tiled(GRASS, x / 6, z / 6) * detail
    patches = tiled(PATCHES, x / 60, z / 60) * 0.6 + tiled(PATCHES, x / 17, z / 17) * 0.4
    albedo = mix(linear("#4e6b26"), linear("#8a9440"), 0.5 + 0.35 * patches)
    albedo = albedo * np.clip(1 + 0.3 * blades, 0.25, None)[..., None]
    albedo = mix(albedo, linear("#e8d75a"), np.clip((tiled(GRASS, x / 3 + 0.4, z / 3) - 2.1) * 3, 0, 1) * detail)
    albedo = mix(albedo, linear("#f0ece6"), np.clip((tiled(GRASS, x / 3, z / 3 + 0.3) - 2.2) * 3, 0, 1) * detail)
    bend = 1.9 + 1.3 * np.sin(z * 0.21) + 0.5 * np.sin(z * 0.53 + 1)
    edge = np.abs(x - bend) - 0.6 - 0.12 * tiled(GRASS, x, z / 2) * detail
    sand = linear("#b79b6d") * np.clip(1 + 0.16 * blades, 0.5, None)[..., None]
    albedo = mix(albedo, sand, np.clip(-edge / (0.08 + 0.01 * far), 0, 1) * np.clip(1.3 - far / 70, 0, 1))
    return mix(albedo * sunlit(1.0), HAZE * 0.7, 1 - np.exp(-far / 1500))


def sunlit(facing: float | np.ndarray) -> np.ndarray:
    """What a white surface shows that gets part of the sun that level ground gets, and the sky."""
    return SUN_IRRADIANCE * SUN_COLOR * SUN[1] * facing + SKY_IRRADIANCE


def linear(color: str) -> np.ndarray:
    """The linear colour of "#rrggbb"."""
    return np.asarray(linear_from_srgb(rgb(color)))


def mix(a: np.ndarray, b: np.ndarray, amount: np.ndarray | float) -> np.ndarray:
    """Colour `a` where amount (...) is 0, `b` where it is 1."""
    amount = np.clip(np.asarray(amount)[..., None], 0, 1)
    return a * (1 - amount) + b * amount


def tiled(tile: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Bilinear look-up in a tile that repeats with every unit."""
    size = len(tile)
    column, row = (u % 1) * size, (v % 1) * size
    left, top = np.floor(column).astype(int), np.floor(row).astype(int)
    across, down = column - left, row - top
    at = [[tile[(top + i) % size, (left + j) % size] for j in (0, 1)] for i in (0, 1)]
    upper, lower = (first + (second - first) * across for first, second in at)
    return upper + (lower - upper) * down


def _cloud(place: np.ndarray) -> np.ndarray:
    warp = 0.015 * tiled(CLOUDS, place[..., 0] * 3, place[..., 1] * 3)
    return tiled(CLOUDS, place[..., 0] + warp, place[..., 1] - warp)
