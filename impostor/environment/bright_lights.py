"""The brightest sources of an environment as directional lights."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from impostor.environment.convolution import Lobe, convolved
from impostor.environment.cube import face_directions, padded, reduced, solid_angles
from impostor.environment.environment import Environment
from impostor.environment.room import Room
from impostor.errors import SettingsError
from impostor.lighting import DirectionalLight

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # Rec. 709
AREA = np.radians(5.0)
"""How widely an environment is blurred to find its brightest direction: standard deviation of the bell, radians."""
NARROW, WIDE = np.radians(2.0), np.radians(30.0)
"""A source stands out where a narrow mean exceeds a wide one: standard deviations of the bells, radians."""
LEAST_CONTRAST = 0.05
"""In parts of the wide mean: what stands out less is no source."""
DEGREE = 128
CELLS, FINEST = 64, 512
"""Along a face: cells in which sources are told apart, and most texels in which they are measured."""
MOST_SOURCES = 64
WIDEST = np.radians(80.0)


def brightest_direction(environment: Environment) -> NDArray[np.float64]:
    """Unit vector, (3,) float64, toward the greatest luminance of an environment blurred with a bell of `AREA`.

    In the environment's axes, within half a degree.

    References
    ----------
    Bjorke, "Image-Based Lighting", GPU Gems 19, section 19.5: shadows may fall from the brightest area.
    """
    (blurred,) = convolved(environment.faces, [_bell(AREA, environment)], [2 * CELLS], [DEGREE])
    return face_directions(2 * CELLS).reshape(-1, 3)[(blurred @ LUMINANCE).argmax()]


def bright_lights(source: Room | Environment, count: int) -> list[DirectionalLight]:
    """The brightest sources of an environment, each as far as it outshines what is around it.

    A source is a connected part of the map: whatever stands out at least half as much as the part's brightest place.

    Parameters
    ----------
    source : Room or Environment
        A room's sources as seen from where its environment was captured.
    count : int
        At least 1. There are fewer lights where there are fewer sources; an even environment has none.

    Returns
    -------
    list of DirectionalLight
        World space, brightest first. `color` is what a white surface that faces the source shows of it, `softness` the
        angular radius of an even disc that would be as large. Together they hold no more light than the environment.

    Raises
    ------
    SettingsError
        A count below 1.
    """
    if count < 1:
        raise SettingsError("bright lights", f"{count} lights; expected at least 1")
    room = source if isinstance(source, Room) else Room.far(source)
    if not room.environment.sources:
        return []
    size = room.environment.size
    cells, texels = min(size, CELLS), min(size, FINEST)
    light, toward = (_by_cell(each, cells) for each in reduced(room.environment.faces, texels))
    angles = _by_cell(np.broadcast_to(solid_angles(texels)[..., None], (6, texels, texels, 1)), cells)
    lights = []
    for inside, around in _sources(room.environment, cells):
        surroundings = np.median((light[around] / angles[around]).reshape(-1, 3), axis=0)
        beyond = (light[inside] - surroundings * angles[inside]).reshape(-1, 3)
        made = _light(room, beyond, toward[inside].reshape(-1, 3), angles[inside].ravel())
        lights += [made] if made else []
    return sorted(lights, key=lambda each: -float(LUMINANCE @ each.color))[:count]


def _sources(environment: Environment, cells: int) -> Iterator[tuple[NDArray[np.bool_], NDArray[np.bool_]]]:
    """Parts of a map that stand out, and what is around each: masks of all cells; the parts do not overlap."""
    lobes = [_bell(deviation, environment) for deviation in (NARROW, WIDE)]
    narrow, wide = (
        (means @ LUMINANCE).ravel() for means in convolved(environment.faces, lobes, [cells, cells], [DEGREE, DEGREE])
    )
    contrast, neighbours = narrow - wide, _neighbours(cells)
    is_peak = (contrast >= contrast[neighbours].max(axis=1)) & (contrast > LEAST_CONTRAST * wide)
    peaks = np.flatnonzero(is_peak)
    taken = np.zeros(len(contrast), bool)
    for peak in peaks[np.argsort(-contrast[peaks], kind="stable")][:MOST_SOURCES]:
        if taken[peak]:
            continue
        inside = _flooded(int(peak), (contrast > contrast[peak] / 2) & ~taken, neighbours)
        # The edge of a source lies in the cells next to those that stand out.
        inside = _grown(inside, neighbours) & ~taken
        taken |= inside
        around = _grown(_grown(inside, neighbours), neighbours) & ~inside
        if around.any():
            yield inside, around


def _flooded(start: int, allowed: NDArray[np.bool_], neighbours: NDArray[np.intp]) -> NDArray[np.bool_]:
    """The cells that can be reached from one over allowed ones."""
    inside = np.zeros_like(allowed)
    inside[start] = True
    while True:
        grown = _grown(inside, neighbours) & allowed
        if grown.sum() <= inside.sum():
            return inside
        inside = grown


def _grown(cells: NDArray[np.bool_], neighbours: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Cells and those next to them."""
    return np.asarray(cells[neighbours].any(axis=1))


def _light(
    room: Room, beyond: NDArray[np.floating], toward: NDArray[np.floating], angles: NDArray[np.floating]
) -> DirectionalLight | None:
    """The light that texels (K,) of a room give beyond their surroundings, or None."""
    shine = np.maximum(beyond @ LUMINANCE, 0)
    middle = shine @ toward
    if not middle.any():
        return None
    middle /= np.linalg.norm(middle)
    color = np.maximum(np.maximum(toward @ middle, 0) @ beyond, 0) * (room.exposure / np.pi)
    if not color.any():
        return None
    # An even disc shines equally on all of its solid angle.
    solid_angle = shine.sum() ** 2 / (shine**2 / angles).sum()
    softness = min(float(np.arccos(1 - min(solid_angle / (2 * np.pi), 1))), WIDEST)
    x, y, z = room.world_directions(middle).tolist()
    red, green, blue = color.tolist()
    return DirectionalLight((x, y, z), (red, green, blue), softness)


def _bell(deviation: float, environment: Environment) -> Lobe:
    """The sphere's normal distribution, von Mises and Fisher's, of at least the width that hides the texels."""
    deviation = max(deviation, 0.75 * np.pi / 2 / environment.size)
    return lambda angles: np.exp((np.cos(angles) - 1) / deviation**2)


def _by_cell(texels: NDArray[np.floating], cells: int) -> NDArray[np.floating]:
    """(6, N, N, C) to (6 * cells * cells, texels of a cell, C)."""
    many = texels.shape[1] // cells
    split = texels.reshape(6, cells, many, cells, many, -1).swapaxes(2, 3)
    return split.reshape(6 * cells * cells, many * many, -1)


def _neighbours(cells: int) -> NDArray[np.intp]:
    """Each cell's number and those of the four next to it, (6 * cells * cells, 5) intp."""
    numbers = padded(np.arange(6.0 * cells * cells).reshape(6, cells, cells, 1))[..., 0].astype(np.intp)
    inner = slice(1, -1)
    crossed = [numbers[:, inner, inner]]
    crossed += [numbers[:, rows, inner] for rows in (slice(2, None), slice(None, -2))]
    crossed += [numbers[:, inner, columns] for columns in (slice(2, None), slice(None, -2))]
    return np.stack(crossed, axis=-1).reshape(-1, 5)
