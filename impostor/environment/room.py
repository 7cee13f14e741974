"""Room: an environment with a place and a size, so that what it mirrors lines up with its walls."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.checks import check_number, check_type, numbers
from impostor.environment.environment import Environment
from impostor.errors import SettingsError
from impostor.views import rotation_about_y

SHAPES = ("far", "sphere", "box")
WALL = 1e-4
"""Part of the half size by which a point may lie beyond a wall and still be inside: rounding puts some there."""
Vector = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Room:
    """An environment with a place and a size.

    Room space is the lighting space of the chapter: the walls are the unit sphere, or the cube from -1 to 1. What a
    direction shows is the environment toward the point of the wall that it meets, as seen from `captured_at`.

    Parameters
    ----------
    environment : Environment
    shape : {"far", "sphere", "box"}
        "far" is infinitely large: of `world_from_room` only the rotation counts.
    world_from_room : ndarray, (4, 4) float64
        Its axes are at right angles and may differ in length.
    captured_at : tuple of float
        Where the environment was captured, room space.
    exposure : float
        Multiplies the environment's light.
    stretched : bool
        The environment is stretched with the room, so that each face of the cube map is one wall of a box, as in the
        chapter; else its directions are those of the world, as a camera in the room captures them.
    outside : tuple of float
        Linear colour of reflections at points outside the room, where there are none.

    Raises
    ------
    SettingsError
        What is no Environment; a number that is none or not finite; a matrix without an inverse, that mirrors, or whose
        axes are not at right angles; a place of capture that is outside.

    References
    ----------
    Bjorke, "Image-Based Lighting", GPU Gems 19, sections 19.2, 19.3 and 19.6.
    """

    environment: Environment
    shape: str = "far"
    world_from_room: NDArray[np.float64] | None = None
    captured_at: Vector = (0.0, 0.0, 0.0)
    exposure: float = 1.0
    stretched: bool = False
    outside: Vector = (1.0, 0.0, 0.0)

    def __post_init__(self):
        check_type("environment", self.environment, Environment, ", as impostor.load_environment gives")
        if self.shape not in SHAPES:
            raise SettingsError("room", f"shape {self.shape!r}; expected one of {', '.join(SHAPES)}")
        given = np.eye(4) if self.world_from_room is None else self.world_from_room
        matrix = np.array(numbers("room", "world_from_room", given, (4, 4)))
        if np.any(matrix[3] != (0, 0, 0, 1)):
            raise SettingsError("room", "world_from_room is not affine; expected (0, 0, 0, 1) as its last row")
        across = matrix[:3, :3].T @ matrix[:3, :3]
        lengths = np.sqrt(np.diag(across))
        if not (lengths.min() > 0 and np.linalg.det(matrix[:3, :3]) > 0):
            raise SettingsError("room", "world_from_room mirrors or has no inverse; expected a rotation and sizes")
        if np.abs(across / np.outer(lengths, lengths) - np.eye(3)).max() > 1e-6:
            raise SettingsError("room", "world_from_room has axes that are not at right angles")
        check_number("room", "exposure", self.exposure, 0)
        outside = numbers("room", "outside", self.outside, (3,))
        if outside.min() < 0:
            raise SettingsError("room", f"outside {self.outside}; expected three finite numbers, none negative")
        captured = numbers("room", "captured_at", self.captured_at, (3,))
        if not self._within(captured):
            raise SettingsError("room", f"captured_at {self.captured_at}; expected a point inside, in room space")
        matrix.flags.writeable = False
        object.__setattr__(self, "world_from_room", matrix)
        object.__setattr__(self, "captured_at", tuple(captured.tolist()))
        object.__setattr__(self, "outside", tuple(outside.tolist()))

    @classmethod
    def far(cls, environment: Environment, yaw: float = 0.0, exposure: float = 1.0) -> Room:
        """Surroundings infinitely far away, turned about +Y by a yaw in radians."""
        return cls(environment, "far", _placed((1, 1, 1), (0, 0, 0), yaw), exposure=exposure)

    @classmethod
    def box(
        cls,
        environment: Environment,
        size: Vector,
        position: Vector = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
        exposure: float = 1.0,
    ) -> Room:
        """A box of some width, height and depth in metres around a position."""
        return cls(
            environment, "box", _placed(numbers("room", "size", size, (3,)) / 2, position, yaw), exposure=exposure
        )

    @classmethod
    def sphere(
        cls,
        environment: Environment,
        radius: float,
        position: Vector = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
        exposure: float = 1.0,
    ) -> Room:
        """A sphere of some radius in metres around a position."""
        check_number("room", "radius", radius, 0, above=True)
        return cls(environment, "sphere", _placed((radius,) * 3, position, yaw), exposure=exposure)

    @cached_property
    def room_from_world(self) -> NDArray[np.float64]:
        """(4, 4) float64."""
        return np.linalg.inv(self.world_from_room)  # type: ignore[arg-type]

    @cached_property
    def environment_from_world(self) -> NDArray[np.float64]:
        """(3, 3) float64: the rotation that turns directions of the world, normals too, into the environment's."""
        linear = np.asarray(self.world_from_room)[:3, :3]
        return (linear / np.linalg.norm(linear, axis=0)).T

    @cached_property
    def environment_from_room(self) -> NDArray[np.float64]:
        """(3, 3) float64: from differences of points in room space to directions of the environment."""
        if self.stretched:
            return np.eye(3)
        return np.diag(np.linalg.norm(np.asarray(self.world_from_room)[:3, :3], axis=0))

    def world_directions(self, directions: ArrayLike) -> NDArray[np.float64]:
        """Directions of the environment (..., 3), as seen from `captured_at`, in the world; of any length but 0."""
        room = np.asarray(directions, np.float64) / np.diag(self.environment_from_room)
        if self.shape == "far":
            return np.asarray(directions, np.float64) @ self.environment_from_world
        return room @ np.asarray(self.world_from_room)[:3, :3].T

    @property
    def key(self) -> Hashable:
        """Equal for rooms that light and mirror alike."""
        matrix = np.asarray(self.world_from_room).tobytes()
        return self.environment, self.shape, matrix, self.captured_at, self.exposure, self.stretched, self.outside

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether points of the world (..., 3) lie inside, walls included, (...) bool; all do where the room is far."""
        return self._within(self.in_room(points))

    def in_room(self, points: ArrayLike) -> NDArray[np.float64]:
        """Points of the world (..., 3) in room space, (..., 3) float64."""
        return np.asarray(points, np.float64) @ self.room_from_world[:3, :3].T + self.room_from_world[:3, 3]

    def directions_toward(
        self, points: ArrayLike, directions: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Where in the environment to look for what rays in the world meet.

        Parameters
        ----------
        points, directions : array_like, (..., 3) float
            World space; directions of any length but 0.

        Returns
        -------
        toward : ndarray, (..., 3) float64
            Directions in the environment, of any length but 0; finite for points outside too.
        inside : ndarray, (...) bool
            False where the point is outside, and the colour is `outside`.

        References
        ----------
        GPU Gems 19, listing 19-2; the box is met by its nearest slab.
        """
        points, directions = np.asarray(points, np.float64), np.asarray(directions, np.float64)
        points, directions = np.broadcast_arrays(points, directions)
        if self.shape == "far":
            return directions @ self.environment_from_world.T, np.ones(directions.shape[:-1], bool)
        start, along = self.in_room(points), directions @ self.room_from_world[:3, :3].T
        along = along / np.linalg.norm(along, axis=-1, keepdims=True)
        inside = self._within(start)
        start = np.where(inside[..., None], start, 0)
        met = start + (_to_sphere if self.shape == "sphere" else _to_box)(start, along)[..., None] * along
        toward = met - self.captured_at
        # A camera on the wall itself sees nothing of the point it touches.
        toward = np.where(np.abs(toward).max(axis=-1, keepdims=True) > 1e-9, toward, along)
        return toward @ self.environment_from_room.T, inside

    def _within(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether points in room space lie inside, walls included."""
        if self.shape == "far":
            return np.ones(points.shape[:-1], bool)
        if self.shape == "sphere":
            return np.linalg.norm(points, axis=-1) <= 1 + WALL
        return np.abs(points).max(axis=-1) <= 1 + WALL


def _to_sphere(start: NDArray[np.float64], along: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance from points inside to the unit sphere along unit vectors: the quadratic of listing 19-2."""
    half_b = (start * along).sum(axis=-1)
    c = np.square(start).sum(axis=-1) - 1
    return np.maximum(np.sqrt(np.maximum(half_b**2 - c, 0)) - half_b, 0)


def _to_box(start: NDArray[np.float64], along: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance from points inside to the cube from -1 to 1 along unit vectors."""
    parallel = np.abs(along) < 1e-12
    reach = (np.sign(along) - start) / np.where(parallel, 1, along)
    return np.maximum(np.where(parallel, np.inf, reach).min(axis=-1), 0)


def _placed(half_sizes: ArrayLike, position: ArrayLike, yaw: float) -> NDArray[np.float64]:
    check_number("room", "yaw", yaw)
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_about_y(yaw) * np.asarray(half_sizes, np.float64)
    matrix[:3, 3] = numbers("room", "position", position, (3,))
    return matrix
