"""Rooms on the GPU: every level of every face of their environments in one texture, and where they stand."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.environment.blending import EDGE
from impostor.environment.colormap import mirrored_faces
from impostor.environment.cube import halved, padded
from impostor.environment.environment import Environment
from impostor.environment.room import SHAPES, Room
from impostor.errors import GpuError, SettingsError
from runtime.gl.programs import set_uniforms

MAX_ROOMS = 4  # as the shader's array has it
ROOM_ROWS = 9  # of four numbers, of each room in that array
ABSENT = 3  # the shape of a room that is not there
BRIGHTEST = 65504.0  # that 16 bits can hold
MOST_MIRRORED = 16  # textures of what fans mirror
LEAST_SIZE = 8  # of a level's faces in texels
DIFFUSE_SIZE = 32  # of the faces of the diffuse light in texels, as the shader has it


class Place(NamedTuple):
    """Where an environment lies in the texture; texels."""

    origin: tuple[int, int]
    size: int
    """Of the faces of level 0."""
    levels: int


class EnvironmentAtlas:
    """Environments in one texture that `environment.glsl` reads, so that a pixel may choose among them.

    Of each there are its faces, the same faces halved again and again, for mirrors that are far away, its prefiltered
    levels, and its diffuse light. A face has a border of its neighbours' texels, so that the filter finds them.

    Parameters
    ----------
    ctx : moderngl.Context
    environments : sequence of Environment
        At least one.

    Attributes
    ----------
    texture : moderngl.Texture
        RGBA16F: radiance brighter than 65504 is that.
    places : tuple of Place

    Raises
    ------
    GpuError
        The GPU cannot hold a texture of that size.
    """

    def __init__(self, ctx: moderngl.Context, environments: Sequence[Environment]):
        extents = [_extent(environment.size) for environment in environments]
        corners, (width, height) = _packed(extents)
        limit = ctx.info["GL_MAX_TEXTURE_SIZE"]
        if max(width, height) > limit:
            sizes = ", ".join(str(environment.size) for environment in environments)
            problem = f"faces of {sizes} texels need a texture of {width}x{height}"
            raise GpuError("environments", f"{problem}; this GPU holds at most {limit}x{limit}")
        self.texture = ctx.texture((width, height), 4, dtype="f2")
        self.texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self.places = tuple(
            self._write(environment, corner) for environment, corner in zip(environments, corners, strict=True)
        )

    def diffuse_faces(self, place: Place) -> NDArray[np.float64]:
        """Where the diffuse light of an environment lies, as `faces_at` says."""
        x, y = level_origin(place.size, max(place.levels, 2))
        return faces_at((place.origin[0] + x, place.origin[1] + y), DIFFUSE_SIZE, self.texture.size)

    def _write(self, environment: Environment, corner: tuple[int, int]) -> Place:
        size, count = environment.size, len(environment.levels)
        for level, faces in enumerate(_halvings(environment.faces, count)):
            x, y = level_origin(size, level)
            _write_faces(self.texture, faces, corner[0] + x, corner[1] + y)
            if level:
                x += 3 * (faces.shape[1] + 2)
                _write_faces(self.texture, environment.levels[level], corner[0] + x, corner[1] + y)
        x, y = level_origin(size, max(count, 2))
        _write_faces(self.texture, environment.diffuse, corner[0] + x, corner[1] + y)
        return Place(corner, size, count)

    def release(self) -> None:
        """Free the texture."""
        self.texture.release()


class MirroredFaces:
    """What fans of some roughness mirror of an environment in a texture each: one look-up instead of two."""

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self._made: dict[tuple[Environment, float], moderngl.Texture] = {}

    def use(self, environment: Environment, roughness: float, unit: int) -> NDArray[np.float64]:
        """Bind the texture, and say where its faces lie, as `faces_at` does."""
        key = environment, roughness
        if key not in self._made:
            while len(self._made) >= MOST_MIRRORED:
                self._made.pop(next(iter(self._made))).release()
            faces = mirrored_faces(environment, roughness)
            side = faces.shape[1] + 2
            texture = self._ctx.texture((3 * side, 2 * side), 4, dtype="f2")
            texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            _write_faces(texture, faces, 0, 0)
            self._made[key] = texture
        # The last used stays longest.
        texture = self._made[key] = self._made.pop(key)
        texture.use(unit)
        return faces_at((0, 0), texture.width // 3 - 2, texture.size)

    def keep(self, environments: Sequence[Environment]) -> None:
        """Free what is not of these environments."""
        for key in [key for key in self._made if key[0] not in environments]:
            self._made.pop(key).release()


def check_rooms(rooms: Sequence[Room]) -> None:
    """Refuse what is not a sequence of rooms, or too many of them.

    Raises
    ------
    SettingsError
    """
    if not isinstance(rooms, Sequence) or isinstance(rooms, str):
        raise SettingsError("rooms", f"a {type(rooms).__name__}; expected a list of Room")
    for number, room in enumerate(rooms):
        if not isinstance(room, Room):
            raise SettingsError("rooms", f"number {number} is a {type(room).__name__}; expected a Room")
    if len(rooms) > MAX_ROOMS:
        raise SettingsError("rooms", f"{len(rooms)} of them; expected at most {MAX_ROOMS}")


class RoomTable:
    """Up to MAX_ROOMS rooms, as the uniforms and the texture that `rooms.glsl` and `environment.glsl` read.

    Attributes
    ----------
    rooms : tuple of Room
    mirrored : MirroredFaces
    version : int
        Grows whenever the rooms change; what was lit in older ones is stale.
    """

    memory_kind = "rooms"

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self.rooms: tuple[Room, ...] = ()
        self._key: tuple[Hashable, ...] = ()
        self._environments: tuple[Environment, ...] = ()
        self._atlas: EnvironmentAtlas | None = None
        self.mirrored = MirroredFaces(ctx)
        self._rows = np.zeros((MAX_ROOMS, ROOM_ROWS, 4), np.float32)
        self.version = 0

    def __len__(self) -> int:
        return len(self.rooms)

    def update(self, rooms: Sequence[Room]) -> None:
        """Take over the rooms of this frame; nothing is written when they are those of the last one."""
        key = tuple(room.key for room in rooms)
        if key == self._key:
            return
        environments = tuple({id(room.environment): room.environment for room in rooms}.values())
        if {id(each) for each in environments} - {id(each) for each in self._environments} or not environments:
            self.release()
            self._atlas = EnvironmentAtlas(self._ctx, environments) if environments else None
            self._environments = environments
            self.mirrored.keep(environments)
        packed = [_room_rows(room, self._place(room.environment)) for room in rooms]
        # Those that are absent are looked at, too: what they show must be a number.
        self._rows[:] = np.array([*packed, *packed[:1] * (MAX_ROOMS - len(packed))]) if packed else 0
        self._rows[len(packed) :, 3, 3] = ABSENT
        self.rooms, self._key = tuple(rooms), key
        self.version += 1

    def bind(self, program: moderngl.Program, unit: int, first: int = 0) -> None:
        """Give a program that includes `rooms.glsl` its uniforms, beginning with some room; there must be one."""
        self.atlas.texture.use(unit)
        # A program that reads the first room only has a shorter array.
        array = program["rooms"]
        assert isinstance(array, moderngl.Uniform)
        rows = self._rows[first:].reshape(-1, 4)[: array.array_length]
        set_uniforms(program, environments=unit, rooms=rows.ravel())

    @property
    def atlas(self) -> EnvironmentAtlas:
        """What holds the environments; there must be a room."""
        assert self._atlas is not None
        return self._atlas

    def place(self, number: int) -> Place:
        """Where in `atlas` the environment of a room lies."""
        return self._place(self.rooms[number].environment)

    def _place(self, environment: Environment) -> Place:
        places = zip(self._environments, self.atlas.places, strict=True)
        return next(place for each, place in places if each is environment)

    def alone_around(self, centers: NDArray[np.float64], radii: NDArray[np.float64]) -> NDArray[np.intp]:
        """The room that alone lights and is mirrored by all that is in a sphere, (N,); -1 where there may be others.

        Parameters
        ----------
        centers : ndarray, (N, 3) float64
            World space.
        radii : ndarray, (N,) float64
        """
        far = [room.shape == "far" for room in self.rooms]
        found = np.array([_within(room, centers, radii) for room in self.rooms])
        inside, beside = found[:, 0], found[:, 1]
        others = (~beside).sum(axis=0)
        alone = np.where(inside.any(axis=0) & (others == 1), inside.argmax(axis=0), -1)
        return np.where(others == 0, far.index(True), alone) if sum(far) == 1 else alone

    def release(self) -> None:
        """Free the textures."""
        if self._atlas is not None:
            self._atlas.release()
        self.mirrored.keep(())
        self._atlas, self._environments, self.rooms, self._key = None, (), (), ()


def _within(
    room: Room, centers: NDArray[np.float64], radii: NDArray[np.float64]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether spheres lie in a room, and whether they lie beside all that it lights; for certain, (N,) each."""
    if room.shape == "far":
        return np.zeros(len(radii), bool), np.ones(len(radii), bool)
    middles, lengths = room.in_room(centers), np.linalg.norm(room.room_from_world[:3, :3], axis=1)
    if room.shape == "sphere":
        away, reach = np.linalg.norm(middles, axis=1), radii * lengths.max()
        return away + reach <= 1, away - reach > 1 + EDGE
    away, reach = np.abs(middles), radii[:, None] * lengths
    return (away + reach <= 1).all(axis=1), (away - reach > 1 + EDGE).any(axis=1)


def _room_rows(room: Room, place: Place) -> NDArray[np.float64]:
    """As `rooms.glsl` reads them, (ROOM_ROWS, 4)."""
    rows = np.zeros((ROOM_ROWS, 4))
    rows[:3] = room.room_from_world[:3]
    rows[3] = *room.captured_at, SHAPES.index(room.shape)
    rows[4] = *np.diag(room.environment_from_room), room.exposure
    rows[5:8, :3], rows[5:8, 3] = room.environment_from_world, room.outside
    rows[8] = *place.origin, place.size, place.levels - 1
    return rows


def level_origin(size: int, level: int) -> tuple[int, int]:
    """Where a level's halved faces lie, from the environment's corner; its prefiltered ones are to the right of them.

    Level 0 fills a row, level 1 another, all others share a third, whose end is the diffuse light.
    """
    first, second = 2 * (size + 2), 2 * (size // 2 + 2)
    if level < 2:
        return 0, level * first
    return 12 * (size // 4 - (size >> level) + level - 2), first + second


def _extent(size: int) -> tuple[int, int]:
    """Width and height of all that belongs to an environment, with an alley that the filter does not cross."""
    levels = (size // LEAST_SIZE).bit_length()
    x, y = level_origin(size, max(levels, 2))
    diffuse = DIFFUSE_SIZE + 2
    return max(3 * (size + 2), 6 * (size // 2 + 2), x + 3 * diffuse), y + 2 * max(size // 4 + 2, diffuse)


def _packed(extents: Sequence[tuple[int, int]]) -> tuple[list[tuple[int, int]], tuple[int, int]]:
    """Corners of rectangles, two in a row, and the size of what holds them."""
    corners, width, y = [], 0, 0
    for start in range(0, len(extents), 2):
        row = extents[start : start + 2]
        corners += [(0, y), (row[0][0], y)][: len(row)]
        width = max(width, sum(extent[0] for extent in row))
        y += max(extent[1] for extent in row)
    return corners, (width, y)


def _halvings(faces: NDArray[np.float32], count: int) -> Iterator[NDArray[np.float32]]:
    """Faces, then each time half as large, every texel the mean of four."""
    for _ in range(count):
        yield faces
        faces = halved(faces)


def faces_at(origin: tuple[int, int], size: int, texture: tuple[int, int]) -> NDArray[np.float64]:
    """Where six faces lie in a texture of some size, as `texel_of` of `environment.glsl` reads it, (3, 2) float64."""
    middle = np.add(origin, size / 2 + 1)
    return np.stack([middle, (size / 2,) * 2, (size + 2,) * 2]) / texture


def _write_faces(texture: moderngl.Texture, faces: NDArray[np.float32], x: int, y: int) -> None:
    """Write six faces, three beside each other in each of two rows."""
    bordered = padded(np.minimum(faces, BRIGHTEST))
    side = bordered.shape[1]
    texels = np.zeros((2, side, 3, side, 4), np.float16)
    texels[..., :3] = bordered.reshape(2, 3, side, side, 3).swapaxes(1, 2)
    texture.write(texels.tobytes(), viewport=(x, y, 3 * side, 2 * side))
