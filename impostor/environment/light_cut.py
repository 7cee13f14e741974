"""A whole environment as a few directional lights, for what knows only lights: PTMs, and callers' own shaders."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from impostor.environment.bright_lights import LUMINANCE
from impostor.environment.cube import reduced
from impostor.environment.environment import Environment
from impostor.environment.room import Room
from impostor.errors import SettingsError
from impostor.lighting import DirectionalLight

FINEST = 64  # texels along a face: finer ones are put together first


def light_cut(environment: Environment, count: int) -> list[DirectionalLight]:
    """Lights that stand for all that an environment shines with.

    The sphere is halved again and again so that both halves are equally bright; every part becomes one light, which
    stands where the part's light comes from on average.

    Parameters
    ----------
    environment : Environment
    count : int
        At least 1. An environment whose light comes from fewer texels gives fewer lights, a dark one none.

    Returns
    -------
    list of DirectionalLight
        In the environment's axes, brightest first; together they hold all of its light.

    Raises
    ------
    SettingsError
        A count below 1.

    References
    ----------
    Debevec, "A Median Cut Algorithm for Light Probe Sampling", SIGGRAPH 2005 posters.
    """
    if count < 1:
        raise SettingsError("light cut", f"{count} lights; expected at least 1")
    directions, power = _texels(environment)
    parts = [np.flatnonzero(power @ LUMINANCE > 0)]
    while len(parts) < count:
        brightness = [_brightness(power[part]) if len(part) > 1 else 0.0 for part in parts]
        if max(brightness) == 0:
            break
        parts.extend(_halves(parts.pop(int(np.argmax(brightness))), directions, power))
    lights = [_light(directions[part], power[part]) for part in parts if len(part)]
    return sorted(lights, key=lambda light: -float(LUMINANCE @ light.color))


def in_world(lights: Sequence[DirectionalLight], room: Room, share: float = 1.0) -> list[DirectionalLight]:
    """Lights of a room's environment as the room turns and exposes them, `share` of their light."""
    if not lights:
        return []
    toward = room.world_directions([light.toward for light in lights])
    color = np.array([light.color for light in lights]) * (room.exposure * share)
    return [
        DirectionalLight((x, y, z), (red, green, blue), light.softness)
        for (x, y, z), (red, green, blue), light in zip(toward.tolist(), color.tolist(), lights, strict=True)
    ]


def _texels(environment: Environment) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where the texels are that shine, (K, 3), and with what irradiance / pi on what faces them, (K, 3)."""
    power, toward = reduced(environment.faces, min(environment.size, FINEST))
    return toward.reshape(-1, 3), power.reshape(-1, 3) / np.pi


def _brightness(power: NDArray[np.float64]) -> float:
    return float((power @ LUMINANCE).sum())


def _halves(
    part: NDArray[np.intp], directions: NDArray[np.float64], power: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """A part, halved by light across the axis along which it spreads furthest."""
    weights = power[part] @ LUMINANCE
    spread = directions[part] - np.average(directions[part], axis=0, weights=weights)
    axis = int(np.argmax(weights @ spread**2))
    order = part[np.argsort(directions[part, axis], kind="stable")]
    light = np.cumsum(power[order] @ LUMINANCE)
    middle = int(np.clip(np.searchsorted(light, light[-1] / 2) + 1, 1, len(order) - 1))
    return order[:middle], order[middle:]


def _light(directions: NDArray[np.float64], power: NDArray[np.float64]) -> DirectionalLight:
    x, y, z = ((power @ LUMINANCE) @ directions).tolist()
    red, green, blue = power.sum(axis=0).tolist()
    return DirectionalLight((x, y, z) if (x, y, z) != (0, 0, 0) else (0.0, 1.0, 0.0), (red, green, blue))
