"""Surroundings to colormap: 225 colours light a whole fan by all that is around it. The GPU path equals this one."""

from __future__ import annotations

from collections.abc import Sequence
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.environment.blending import diffuse_weights, mirrored_room
from impostor.environment.cube import face_directions, halved, padded, sample, sample_padded
from impostor.environment.environment import Environment
from impostor.environment.reflection import Reflection
from impostor.environment.room import Room
from impostor.fan import DEPTH_CODES, Fan
from impostor.lighting import Colormap
from impostor.normal_code import BYTE_TO_NORMAL, CODE_COUNT

NORMALS = BYTE_TO_NORMAL[:CODE_COUNT].astype(np.float64)
REFLECTED = 2 * NORMALS[:, 2:] * NORMALS - [0, 0, 1]
"""(225, 3): where an eye infinitely far away looks by way of each normal, view space."""
SHARPEST = 0.1
"""The least roughness with which a fan mirrors, because the directions that its codes mirror lie far apart: with it,
mirrors come 1 dB nearer to the mesh (mean of two sample models in three panoramas: -0.3 to 2.1 dB)."""
ROUND = 0.3  # parts of the radius from the middle at which a surface is expected that a view shows nothing of
FINEST = 128
"""Texels along a face beyond which a fan mirrors no finer: 0.7 degrees, and its codes are 7 apart. Its pictures come as
near to the mesh's as with all texels, within 0.1 dB."""
MOST_MIRRORED = 8  # roughnesses of one environment that are kept
_PADDED: WeakKeyDictionary[Environment, NDArray[np.float32]] = WeakKeyDictionary()
_MIRRORED: WeakKeyDictionary[Environment, dict[float, NDArray[np.float32]]] = WeakKeyDictionary()
SHORT_OF_WALL = 0.999  # of the way from a room's middle to its wall, how far a point reaches that would lie beyond


def environment_colormap(
    view_from_world: ArrayLike,
    positions: ArrayLike,
    rooms: Sequence[Room],
    reflection: Reflection | None = None,
    points: ArrayLike = 0.0,
    lit: Colormap | None = None,
) -> Colormap:
    """The colour of every representable normal in its surroundings.

    Parameters
    ----------
    view_from_world : array_like, (..., 3, 3) float
        Rows right, up, back of the fan's view as the instance is turned in the world.
    positions : array_like, (..., 3) float
        Where the view's centre is, world space: it decides which rooms light the object.
    rooms : sequence of Room
    reflection : Reflection, optional
        Nothing is mirrored without.
    points : array_like, (..., 225, 3) float, optional
        Where the surface lies that has each normal, from the centre in the view's axes, metres: what it mirrors is
        seen from there. `surface_points` of the fan, times the instance's scale.
    lit : Colormap, optional
        What lights give, `impostor.lighting.colormap`; it is added, as far as a metal shows it.

    Returns
    -------
    Colormap
        `diffuse` multiplies the albedo, and what a metal mirrors is in it; `specular` is what is added on top.

    References
    ----------
    Dinh, Metoyer, Turk, "Normal Coding for Shading"; Bjorke, "Image-Based Lighting", GPU Gems 19, listing 19-2.
    """
    basis = np.asarray(view_from_world, np.float64)
    centers = np.broadcast_to(np.asarray(positions, np.float64), (*basis.shape[:-2], 3))
    diffuse, specular = np.zeros((2, *basis.shape[:-2], 256, 3), np.float32) if lit is None else map(np.copy, lit)
    if not rooms:
        return Colormap(diffuse, specular)
    diffuse[..., :CODE_COUNT, :] += _diffuse(NORMALS @ basis, centers, rooms)
    if reflection is not None:
        offsets = np.broadcast_to(np.asarray(points, np.float64), (*basis.shape[:-2], CODE_COUNT, 3)) @ basis
        mirrored = _mirrored(centers, offsets, REFLECTED @ basis, rooms, reflection)
        diffuse *= 1 - reflection.metal
        diffuse[..., :CODE_COUNT, :] += reflection.metal * mirrored
        specular[..., :CODE_COUNT, :] += (1 - reflection.metal) * mirrored
    return Colormap(diffuse, specular)


def surface_points(fan: Fan) -> NDArray[np.float32]:
    """Where, in each view, the surface lies that has each normal: the mean over the texels with its code.

    Parameters
    ----------
    fan : Fan

    Returns
    -------
    ndarray, (V, 225, 3) float32
        From the view's centre in the view's axes, metres. A normal that few texels have is drawn toward a ball.
    """
    size, views = fan.size, fan.views
    across = (np.arange(size) + 0.5) * (2 / size) - 1
    sums = np.zeros((len(views), CODE_COUNT, 4))
    for of_view, codes, depth, silhouette, radius, (low, high) in zip(
        sums, fan.normal[0], fan.depth, fan.silhouette, views.radius, views.depth_range, strict=True
    ):
        row, column = np.nonzero(silhouette & (codes < CODE_COUNT))
        z = low + depth[row, column] * ((high - low) / DEPTH_CODES)
        reach = radius * (1 - z / views.distance)
        for axis, values in enumerate((across[column] * reach, -across[row] * reach, z, np.ones_like(z))):
            of_view[:, axis] = np.bincount(codes[row, column], values, CODE_COUNT)
    ball = NORMALS * (ROUND * fan.radius)
    return ((sums[..., :3] + ball) / (sums[..., 3:] + 1)).astype(np.float32)


def diffuse_light(environment: Environment, normals: ArrayLike) -> NDArray[np.float32]:
    """`Environment.diffuse` at normals (..., 3) of any length, quickly again and again."""
    if environment not in _PADDED:
        _PADDED[environment] = padded(environment.diffuse)
    return sample_padded(_PADDED[environment], normals)


def mirrored_faces(environment: Environment, roughness: float) -> NDArray[np.float32]:
    """What fans of some roughness mirror, as one cube map: two of the environment's levels, mixed once for all.

    Parameters
    ----------
    environment : Environment
    roughness : float
        0 to 1; what is below SHARPEST is that.

    Returns
    -------
    ndarray, (6, N, N, 3) float32
        N is at most FINEST. Its bilinear look-up is `Environment.mirrored` but for what is lost between the texels of
        the coarser level, where that one has a kink.
    """
    levels = environment.levels
    height = max(roughness, SHARPEST) * (len(levels) - 1)
    finer = min(int(height), max(len(levels) - 2, 0))
    faces, part = levels[finer], height - finer
    while faces.shape[1] > FINEST:
        faces = halved(faces)
    if part == 0:
        return faces
    return ((1 - part) * faces + part * sample(levels[finer + 1], face_directions(faces.shape[1]))).astype(np.float32)


def _diffuse(normals: NDArray[np.float64], centers: NDArray[np.float64], rooms: Sequence[Room]) -> NDArray[np.float64]:
    """Diffuse light (..., N, 3) of normals (..., N, 3) of the world, blended between rooms."""
    weights = diffuse_weights(rooms, centers)
    light = np.zeros(normals.shape)
    for number, room in enumerate(rooms):
        seen = diffuse_light(room.environment, normals @ room.environment_from_world.T)
        light += (room.exposure * weights[..., number])[..., None, None] * seen
    return light


def _mirrored(
    centers: NDArray[np.float64],
    offsets: NDArray[np.float64],
    directions: NDArray[np.float64],
    rooms: Sequence[Room],
    reflection: Reflection,
) -> NDArray[np.float64]:
    """Light (..., 225, 3) from directions (..., 225, 3) of the world, mirrored beside the centres (..., 3)."""
    chosen, roughness = mirrored_room(rooms, centers), max(reflection.roughness, SHARPEST)
    light = np.zeros(directions.shape)
    for number, room in enumerate(rooms):
        here = chosen == number
        if np.any(here):
            points = _kept_inside(room, centers[here], offsets[here])
            toward, inside = room.directions_toward(points, directions[here])
            seen = room.exposure * _mirrored_light(room.environment, toward, roughness)
            seen = reflection.fresnel(NORMALS[:, 2])[:, None] * seen
            light[here] = np.where(inside[..., None], seen, room.outside)
    return light


def _mirrored_light(environment: Environment, toward: NDArray[np.float64], roughness: float) -> NDArray[np.float32]:
    if environment.size > FINEST:
        kept = _MIRRORED.setdefault(environment, {})
        if roughness not in kept:
            while len(kept) >= MOST_MIRRORED:
                del kept[next(iter(kept))]
            kept[roughness] = padded(mirrored_faces(environment, roughness))
        return sample_padded(kept[roughness], toward)
    return environment.mirrored(toward, roughness)


def _kept_inside(room: Room, centers: NDArray[np.float64], offsets: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (..., N, 3) beside the centres (..., 3), none of them beyond a wall that its centre is not beyond."""
    points = centers[..., None, :] + offsets
    if room.shape == "far":
        return points
    within = points @ room.room_from_world[:3, :3].T + room.room_from_world[:3, 3]
    lengths = np.linalg.norm(within, axis=-1, keepdims=True) if room.shape == "sphere" else np.abs(within)
    within = within * np.minimum(SHORT_OF_WALL / np.maximum(lengths, 1e-12), 1)
    world_from_room = np.asarray(room.world_from_room)
    kept = within @ world_from_room[:3, :3].T + world_from_room[:3, 3]
    return np.where(room.contains(centers)[..., None, None], kept, points)
