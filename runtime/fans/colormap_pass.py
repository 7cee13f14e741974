"""Light into pictures: the colormap pass writes the 225 entries, the relight pass sends tiles through them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.environment.reflection import Reflection
from impostor.normal_code import BYTE_TO_NORMAL, CODE_COUNT
from runtime.gl.programs import load_program, set_uniforms
from runtime.gl.state import clear_color, set_state
from runtime.gl.uploads import InstanceBuffer
from runtime.lights.light_table import LightTable
from runtime.rooms.environments import MAX_ROOMS, RoomTable

ROW_DTYPE = np.dtype(
    [
        ("row", "f4"),
        ("basis", "f4", (3, 3)),
        ("albedo", "f4", (4,)),
        ("gloss", "f4", (2,)),
    ]
)
PLACE_DTYPE = np.dtype(
    [
        ("center", "f4", (3,)),
        ("scale", "f4"),
        ("weights", "f4", (4,)),
        ("mirrored", "f4", (4,)),
        ("view", "f4"),
    ]
)
# What the shader calls the numbers of these records, and how many they are.
ROW_ATTRIBUTES = {"number": 1, "right": 3, "up": 3, "back": 3, "albedo": 4, "gloss": 2}
PLACE_ATTRIBUTES = {"center": 3, "scale": 1, "weights": 4, "chosen": 4, "view": 1}
PROGRAMS = "lights", "gloss", "normals", "diffuse", "far", "near", "srgb", "finished"
TILE, TILES_ACROSS = 16, 2  # pixels, and rows of a colormap side by side
DEFAULTS = {
    "of_all": 1,
    "of_weights": (0.0,) * MAX_ROOMS,
    "of_chosen": (0.0,) * MAX_ROOMS,
    "turn": np.eye(3),
    "byte_to_normal": 0,
}


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What the rows of a colormap have around them.

    Parameters
    ----------
    rooms : RoomTable
        At least one room.
    places : ndarray, (N,) PLACE_DTYPE
        For each row: the view's centre in the world, the instance's scale, each room's part in the diffuse light, 1
        for the room that is mirrored, and the view. One room alone has no parts to be told.
    reflection : Reflection, optional
    points : moderngl.Texture, optional
        `FanTextures.points`, for what mirrors.
    """

    rooms: RoomTable
    places: NDArray[np.void]
    reflection: Reflection | None = None
    points: moderngl.Texture | None = None


class ColormapPass:
    """Evaluates colormaps on the GPU.

    Equals `impostor.lighting.colormap`, and with surroundings `impostor.environment.colormap`.

    Attributes
    ----------
    texture : moderngl.Texture
        float32 RGBA: each of `ROWS` rows is two tiles of 16 x 16 texels, entry after entry, where `tile_origins` says.
        The first holds linear colours that multiply the albedo, the second those that are added on top; of a fan with
        one albedo the first holds the finished colours on the sRGB curve, and the second is not used.

    Notes
    -----
    Lights, and every room, add their light in a program that does nothing else: a software rasteriser also runs what
    branches and loops leave out. Tiles are points, so that what is the same for a row is worked out once for a vertex.
    """

    memory_kind = "colormaps"

    ROWS = 1024

    def __init__(self, ctx: moderngl.Context):
        self._normals, self._fresnel = (
            ctx.texture((256, 1), 4, _padded_normals().tobytes(), dtype="f4") for _ in range(2)
        )
        self._reflection: Reflection | None = None  # whose part of the light `_fresnel` has
        size = TILE * TILES_ACROSS, TILE * self.ROWS // TILES_ACROSS
        # Entries without a normal, and what is on no albedo, stay zero.
        self.texture = ctx.texture((2 * size[0], size[1]), 4, bytes(2 * size[0] * size[1] * 16), dtype="f4")
        self._made = ctx.texture(size, 4, dtype="f4")
        for texture in (self.texture, self._normals, self._fresnel, self._made):
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._target, self._made_target = ctx.framebuffer([self.texture]), ctx.framebuffer([self._made])
        self._rows, self._places = InstanceBuffer(ctx, ROW_DTYPE), InstanceBuffer(ctx, PLACE_DTYPE)
        self._arrays = {name: self._array(ctx, name) for name in PROGRAMS}
        self._uniforms = {name: frozenset(array.program) for name, array in self._arrays.items()}

    def _array(self, ctx: moderngl.Context, name: str) -> moderngl.VertexArray:
        program = load_program(ctx, "colormap_tile.vert", f"colormap_{name}.frag")
        layout = []
        for records, sizes in ((self._rows, ROW_ATTRIBUTES), (self._places, PLACE_ATTRIBUTES)):
            taken = [each for each in sizes if each in program]
            formats = [f"{size}f" if each in program else f"{4 * size}x" for each, size in sizes.items()]
            layout += [(records.buffer, " ".join(formats), *taken)] if taken else []
        return ctx.vertex_array(program, layout)

    def write(
        self,
        rows: NDArray[np.void],
        lights: LightTable,
        normals_for: NDArray[np.float64] | None = None,
        surroundings: Surroundings | None = None,
    ) -> None:
        """Fill the rows named in a ROW_DTYPE array; changes the bound framebuffer and texture units 0 to 5.

        With `normals_for`, a viewer's (3, 3) rotation from world to view, the entries are that viewer's normals as
        n / 2 + 1/2 instead of light.
        """
        folded = rows["albedo"][:, 3] > 0
        if normals_for is not None:
            rows, folded = rows.copy(), np.zeros(len(rows), bool)
            rows["albedo"][:, 3] = 0
        self._rows.write(rows)
        self._places.write(np.zeros(len(rows), PLACE_DTYPE) if surroundings is None else surroundings.places)
        self._normals.use(0)
        if not folded.all():
            self._begin(self._target, rows[~folded])
            for name, light in self._lights(rows, lights, normals_for, surroundings):
                self._draw(name, len(rows), folded=False, parts_drawn=2, **light)
        if folded.any():
            self._write_folded(rows, rows[folded], lights, surroundings)

    def _write_folded(
        self, rows: NDArray[np.void], folded: NDArray[np.void], lights: LightTable, surroundings: Surroundings | None
    ) -> None:
        """Fill those of some rows that have one albedo, which are also given alone."""
        if surroundings is None:
            self._begin(self._target, folded, add=False)
            lights.bind(self._arrays["finished"].program, 1)
            self._draw("finished", len(rows), folded=True, parts_drawn=2, parts=(1, 0))
            return
        self._begin(self._made_target, folded)
        for name, light in self._lights(rows, lights, None, surroundings):
            self._draw(name, len(rows), folded=True, parts_drawn=1, **light)
        self._begin(self._target, folded, add=False)
        self._made.use(2)
        self._draw("srgb", len(rows), folded=True, parts_drawn=2, parts=(1, 1), made=2)

    def _begin(self, target: moderngl.Framebuffer, rows: NDArray[np.void], add: bool = True) -> None:
        """Draw into the tiles of some rows from now on; what is drawn is added, or replaces what is there."""
        first, last = int(rows["row"].min()) // TILES_ACROSS, int(rows["row"].max()) // TILES_ACROSS
        target.scissor = 0, TILE * first, target.width, TILE * (last + 1 - first)
        target.use()
        if add:
            clear_color()
        set_state(blend=(moderngl.ONE, moderngl.ONE) if add else None, points=True)

    def _lights(
        self,
        rows: NDArray[np.void],
        lights: LightTable,
        normals_for: NDArray[np.float64] | None,
        surroundings: Surroundings | None,
    ) -> Iterator[tuple[str, dict[str, Any]]]:
        """Programs that add all there is, and their uniforms; `parts` of it multiply the albedo, and are on top."""
        if normals_for is not None:
            yield "normals", {"parts": (1, 0), "turn": normals_for}
            return
        reflection = None if surroundings is None else surroundings.reflection
        metal = 0.0 if reflection is None else reflection.metal
        if metal < 1 and (lights.count or any(lights.ambient)):
            lights.bind(self._arrays["lights"].program, 1)
            yield "lights", {"parts": (1 - metal, 0)}
        if lights.count and rows["gloss"][:, 0].any():
            lights.bind(self._arrays["gloss"].program, 1)
            yield "gloss", {"parts": (0, 1)}
        if surroundings is None:
            return
        for number in range(len(surroundings.rooms)):
            if metal < 1:
                surroundings.rooms.atlas.texture.use(3)
                yield "diffuse", {"parts": (1 - metal, 0), **_diffuse(surroundings, number)}
            if reflection is not None:
                parts = metal, 1 - metal
                self._mirrors(reflection)
                if surroundings.rooms.rooms[number].shape == "far":
                    yield "far", {"parts": parts, **_mirrored(surroundings, reflection, number), "byte_to_normal": 4}
                else:
                    assert surroundings.points is not None
                    surroundings.points.use(5)
                    surroundings.rooms.bind(self._arrays["near"].program, 3, first=number)
                    yield (
                        "near",
                        {
                            "parts": parts,
                            "points": 5,
                            **_mirrored(surroundings, reflection, number),
                            "byte_to_normal": 4,
                        },
                    )

    def _mirrors(self, reflection: Reflection) -> None:
        """Bind normals with the part of the light that a surface mirrors by way of each."""
        self._fresnel.use(4)
        if reflection != self._reflection:
            normals = _padded_normals()
            normals[:CODE_COUNT, 3] = reflection.fresnel(normals[:CODE_COUNT, 2])
            self._fresnel.write(normals.tobytes())
            self._reflection = reflection

    def _draw(self, name: str, count: int, **uniforms: Any) -> None:
        array, wanted = self._arrays[name], self._uniforms[name]
        values = DEFAULTS | {"row_count": self.ROWS} | uniforms
        set_uniforms(array.program, **{key: value for key, value in values.items() if key in wanted})
        array.render(moderngl.POINTS, vertices=count, instances=2 - uniforms["folded"])

    def release(self) -> None:
        """Free everything this pass made."""
        for array in self._arrays.values():
            program = array.program
            array.release()
            program.release()
        self._arrays.clear()
        for resource in (
            self._rows,
            self._places,
            self._target,
            self._made_target,
            self.texture,
            self._made,
            self._normals,
            self._fresnel,
        ):
            resource.release()


def tile_origins(rows: ArrayLike) -> NDArray[np.intp]:
    """The first texel (..., 2) of each colormap row's first tile in `ColormapPass.texture`; the second is beside it."""
    numbers = np.asarray(rows, np.intp)
    return TILE * np.stack([2 * (numbers % TILES_ACROSS), numbers // TILES_ACROSS], axis=-1)


def _diffuse(surroundings: Surroundings, number: int) -> dict[str, Any]:
    """The uniforms of the diffuse light of one of the rooms."""
    table = surroundings.rooms
    room, level = table.rooms[number], table.atlas.diffuse_faces(table.place(number))
    light = {"turn": room.environment_from_world, "environments": 3, "level": level}
    return light | _shares(table, number, "of_weights", room.exposure)


def _mirrored(surroundings: Surroundings, reflection: Reflection, number: int) -> dict[str, Any]:
    """The uniforms of what is mirrored of one of the rooms, whose texture is bound then."""
    table = surroundings.rooms
    room = table.rooms[number]
    light = {"environments": 3, "level": table.mirrored.use(room.environment, reflection.roughness, 3)}
    if room.shape == "far":
        return light | {"turn": room.environment_from_world} | _shares(table, number, "of_chosen", room.exposure)
    matrix = room.room_from_world
    return light | {"turn": matrix[:3, :3], "shift": matrix[:3, 3]} | _shares(table, number, "of_chosen", 1.0)


def _shares(table: RoomTable, number: int, among: str, exposure: float) -> dict[str, Any]:
    """One room alone has all rows; others have what the rows say."""
    return {"of_all": exposure} if len(table) == 1 else {"of_all": 0, among: exposure * np.eye(MAX_ROOMS)[number]}


def _padded_normals() -> NDArray[np.float32]:
    """Normals of all codes, (256, 4), with 1 for those that are some, and some normal for the others."""
    normals = np.zeros((256, 4), np.float32)
    normals[:CODE_COUNT, :3], normals[:CODE_COUNT, 3] = BYTE_TO_NORMAL[:CODE_COUNT], 1
    normals[CODE_COUNT:, 2] = 1
    return normals
