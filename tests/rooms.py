"""Rooms whose walls are painted by a formula: what is in them is known without any picture."""

from dataclasses import replace

import numpy as np

from impostor.environment import Environment, Room
from impostor.environment.cube import face_directions

DARK, BRIGHT = 0.1, 0.9


def meet(room, points, directions):
    """Where on the walls, in room space, rays from points inside end; by the definition of a box and a sphere."""
    linear, origin = room.room_from_world[:3, :3], room.room_from_world[:3, 3]
    start, along = np.broadcast_arrays(points @ linear.T + origin, directions @ linear.T)
    if room.shape == "sphere":
        a, b, c = ((along**2).sum(axis=-1), 2 * (start * along).sum(axis=-1), (start**2).sum(axis=-1) - 1)
        reach = (-b + np.sqrt(np.maximum(b**2 - 4 * a * c, 0))) / (2 * a)
    else:
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = np.nanmin(np.maximum((1 - start) / along, (-1 - start) / along), axis=-1)
    return start + reach[..., None] * along


def windows(walls):
    """1 in the windows of walls (..., 3): one of its own on each side, above and below, none of them symmetric."""
    x, y, z = np.moveaxis(walls / np.abs(walls).max(axis=-1, keepdims=True), -1, 0)
    return np.select(
        [x > 0.9999, x < -0.9999, z > 0.9999, z < -0.9999, y > 0.9999],
        [
            (np.abs(y - 0.1) < 0.5) & (np.abs(z + 0.2) < 0.4),
            np.hypot(y + 0.2, z - 0.3) < 0.5,
            (np.abs(x - 0.3) < 0.3) & (np.abs(y) < 0.7),
            (np.abs(x + 0.4) < 0.2) & (np.abs(y - 0.2) < 0.3),
            np.abs(x) + np.abs(z) < 0.4,
        ],
        (np.abs(x - 0.5) < 0.25) & (np.abs(z - 0.5) < 0.25),
    ).astype(float)


def painted(room, paint=windows, size=512, samples=4):
    """The room with the environment that its painted walls make at its point of capture.

    Parameters
    ----------
    room : Room
        What its environment is does not matter.
    paint : callable
        Numbers 0 to 1, or colours, of points of the walls in room space.
    size, samples : int
        Texels along a face's side, rays along a texel's side.
    """
    fine = face_directions(size * samples)
    linear, origin = room.world_from_room[:3, :3], room.world_from_room[:3, 3]
    middle = linear @ room.captured_at + origin
    to_world = linear if room.stretched else room.environment_from_world.T
    faces = []
    for directions in fine:
        color = paint(meet(room, middle, directions @ to_world.T))
        color = color[..., None] * np.ones(3) if color.ndim == 2 else color
        faces.append(color.reshape(size, samples, size, samples, 3).mean(axis=(1, 3)))
    light = DARK + (BRIGHT - DARK) * np.stack(faces)
    return replace(room, environment=Environment("painted", light))


EMPTY = Environment("empty", np.zeros((6, 8, 8, 3)))


def turned_box(captured_at=(0.0, 0.0, 0.0)):
    """A box that is neither in the middle of the world nor along its axes."""
    room = Room.box(EMPTY, (5, 3, 7), (0.5, 1.5, -0.4), 0.5)
    return replace(room, captured_at=captured_at)


def turned_sphere(captured_at=(0.0, 0.0, 0.0)):
    """As `turned_box`."""
    room = Room.sphere(EMPTY, 2.5, (0.5, 1.5, -0.4), 0.5)
    return replace(room, captured_at=captured_at)
