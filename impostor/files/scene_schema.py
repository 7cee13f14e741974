"""What a scene file may say: every key, its kind, range and default. SCENE.md is the normative text."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from impostor.environment.room import SHAPES
from impostor.fan import MAX_SIZE, MIN_SIZE
from impostor.srgb import linear_from_srgb
from impostor.views import LAYOUTS, MAX_VIEWS

FARTHEST = 100_000.0
MOST_COPIES = 1_000_000
MOST_CORNERS = 1000
MOST_ROOMS = 4
MAP_SUFFIXES = (".hdr", ".exr")
MODEL_SUFFIXES = (".3mf", ".dae", ".glb", ".gltf", ".obj", ".off", ".ply", ".stl")
_COUNT_WORDS = {2: "two", 3: "three", 4: "four"}
_HEX_COLOR = re.compile(r"#[0-9A-Fa-f]{6}")


class WrongValue(Exception):
    """A value that is not of its key's kind."""


@dataclass(frozen=True)
class Number:
    """A finite number; `above` leaves out the lowest itself."""

    low: float
    high: float
    above: bool = False

    @property
    def expected(self) -> str:
        if self.above:
            return f"a number above {_digits(self.low)} and at most {_digits(self.high)}"
        return f"a number from {_digits(self.low)} to {_digits(self.high)}"

    def read(self, value: Any) -> float:
        if not _is_number(value) or not self.low <= value <= self.high or (self.above and value == self.low):
            raise WrongValue
        return float(value)


@dataclass(frozen=True)
class Whole:
    low: int
    high: int

    @property
    def expected(self) -> str:
        return f"a whole number from {self.low:,} to {self.high:,}"

    def read(self, value: Any) -> int:
        if not isinstance(value, int) or isinstance(value, bool) or not self.low <= value <= self.high:
            raise WrongValue
        return value


@dataclass(frozen=True)
class Flag:
    expected = "true or false"

    def read(self, value: Any) -> bool:
        if not isinstance(value, bool):
            raise WrongValue
        return value


@dataclass(frozen=True)
class Choice:
    options: tuple[Any, ...]

    @property
    def expected(self) -> str:
        return _either([f'"{option}"' if isinstance(option, str) else str(option) for option in self.options])

    def read(self, value: Any) -> Any:
        if isinstance(value, bool) or not isinstance(value, (str, int)) or value not in self.options:
            raise WrongValue
        return value


@dataclass(frozen=True)
class Numbers:
    """Several numbers of one range."""

    count: int
    each: Number = Number(-FARTHEST, FARTHEST)

    @property
    def expected(self) -> str:
        return f"{_COUNT_WORDS[self.count]} {self.each.expected.removeprefix('a ').replace('number', 'numbers', 1)}"

    def read(self, value: Any) -> tuple[float, ...]:
        if not isinstance(value, list) or len(value) != self.count:
            raise WrongValue
        return tuple(map(self.each.read, value))


@dataclass(frozen=True)
class Standing:
    """[x, y, z], or [x, z] of what stands on the ground."""

    expected = f"[x, y, z], or [x, z] on the ground, numbers from {-FARTHEST:,.0f} to {FARTHEST:,.0f}"

    def read(self, value: Any) -> tuple[float, ...]:
        if not isinstance(value, list) or len(value) not in (2, 3):
            raise WrongValue
        return Numbers(len(value)).read(value)


@dataclass(frozen=True)
class Range:
    """One number, or the lowest and the highest."""

    each: Number

    @property
    def expected(self) -> str:
        return f"{self.each.expected}, or two of them, the lower one first"

    def read(self, value: Any) -> tuple[float, float]:
        if _is_number(value):
            value = [value, value]
        if not isinstance(value, list) or len(value) != 2:
            raise WrongValue
        low, high = map(self.each.read, value)
        if low > high:
            raise WrongValue
        return low, high


@dataclass(frozen=True)
class Color:
    """Linear numbers, one of them for a grey, or sRGB as a string."""

    high: float

    @property
    def expected(self) -> str:
        return f'one or three linear numbers from 0 to {_digits(self.high)}, or "#rrggbb" on the sRGB curve'

    def read(self, value: Any) -> tuple[float, ...]:
        if isinstance(value, str) and _HEX_COLOR.fullmatch(value):
            return tuple(linear_from_srgb([int(value[at : at + 2], 16) / 255 for at in (1, 3, 5)]).tolist())
        if _is_number(value):
            value = [value] * 3
        return Numbers(3, Number(0, self.high)).read(value)


@dataclass(frozen=True)
class Corners:
    expected = f"3 to {MOST_CORNERS:,} corners [x, z], numbers from {-FARTHEST:,.0f} to {FARTHEST:,.0f}"

    def read(self, value: Any) -> tuple[tuple[float, ...], ...]:
        if not isinstance(value, list) or not 3 <= len(value) <= MOST_CORNERS:
            raise WrongValue
        return tuple(map(Numbers(2).read, value))


@dataclass(frozen=True)
class FileName:
    """A path; that it leads to a file is for the reader to see."""

    suffixes: tuple[str, ...]

    @property
    def expected(self) -> str:
        return f"the path of a {_either(self.suffixes)} file"

    def read(self, value: Any) -> str:
        if not isinstance(value, str) or "\0" in value or not value.lower().endswith(self.suffixes):
            raise WrongValue
        return value


@dataclass(frozen=True)
class MapName(FileName):
    """An environment map: a file, or a folder of six faces."""

    @property
    def expected(self) -> str:
        return f"{super().expected}, or of a folder with six faces"

    def read(self, value: Any) -> str:
        return value if isinstance(value, str) and value and "\0" not in value else super().read(value)


@dataclass(frozen=True)
class Table:
    keys: Mapping[str, Key]
    expected = "a table"


@dataclass(frozen=True)
class Tables:
    keys: Mapping[str, Key]
    most: int
    expected = "tables, each below a header in double brackets"


REQUIRED = object()
"""The default of a key that must be there. None is that of a key that may be left out."""


@dataclass(frozen=True)
class Key:
    """One key: what it takes, what it is when it is left out, and its unit for SCENE.md."""

    kind: Any
    default: Any = None
    unit: str = ""


_POSITION = Number(-FARTHEST, FARTHEST)
_LENGTH = Number(0, FARTHEST, above=True)
_TURN = Number(-360, 360)
_SCALE = Number(0, 1000, above=True)
_LIGHT, _ALBEDO = Color(1000), Color(1)
_UP = {"up": Key(Choice(("y", "z")), "y")}
_GLOSS = {
    "gloss": Key(Number(0, 100), 0.0),
    "shininess": Key(Number(0, 10_000, above=True), 32.0),
}
REFLECTION = {
    "strength": Key(Number(0, 1), 1.0),
    "least": Key(Number(0, 1), 0.05),
    "exponent": Key(Number(0, 64), 5.0),
    "roughness": Key(Number(0, 1), 0.0),
    "metal": Key(Number(0, 1), 0.0),
}
_REFLECTION = {"reflection": Key(Table(REFLECTION))}
_PLACE = {
    "position": Key(Standing(), [0.0, 0.0], "m"),
    "yaw_deg": Key(_TURN, 0.0, "degrees"),
}
BAKE = {
    "views": Key(Whole(1, MAX_VIEWS), 96),
    "elevation_deg": Key(Number(-89, 89), None, "degrees"),
    "layout": Key(Choice(LAYOUTS), "ring"),
    "size": Key(Whole(MIN_SIZE, MAX_SIZE), 256, "texels"),
    "samples": Key(Choice((1, 2, 4))),
}
_SUBJECT = {
    "fan": Key(FileName((".fan",))),
    "model": Key(FileName(MODEL_SUFFIXES)),
    **_UP,
    "bake": Key(Table(BAKE)),
    "lod": Key(Flag(), False),
    **_GLOSS,
    **_REFLECTION,
}
CAMERA_PATH = {
    "time": Key(Number(0, 86_400), REQUIRED, "s"),
    "eye": Key(Standing(), REQUIRED, "m"),
    "target": Key(Numbers(3), REQUIRED, "m"),
}
CAMERA = {
    "eye": Key(Standing(), None, "m"),
    "target": Key(Numbers(3), None, "m"),
    "fov_deg": Key(Number(1, 170), 50.0, "degrees"),
    "near": Key(_LENGTH, None, "m"),
    "far": Key(_LENGTH, None, "m"),
    "walking_height": Key(_LENGTH, 1.7, "m"),
    "path": Key(Tables(CAMERA_PATH, 10_000)),
}
LIGHT = {
    "azimuth_deg": Key(_TURN, REQUIRED, "degrees"),
    "elevation_deg": Key(Number(-90, 90), REQUIRED, "degrees"),
    "color": Key(_LIGHT, [1.0, 1.0, 1.0]),
}
SUN = {
    "time_of_day": Key(Number(0, 24), 12.0, "hours"),
    "latitude_deg": Key(Number(-90, 90), 45.0, "degrees"),
    "day_of_year": Key(Whole(1, 365), 172),
    "north_deg": Key(_TURN, 180.0, "degrees"),
    "hours_per_second": Key(Number(-24, 24), 0.0, "hours/s"),
    "color": Key(_LIGHT, [1.0, 1.0, 1.0]),
    "skylight": Key(Number(0, 100), 0.5),
}
GROUND = {
    "height": Key(_POSITION, 0.0, "m"),
    "tilt_deg": Key(Number(0, 60), 0.0, "degrees"),
    "tilt_azimuth_deg": Key(_TURN, 0.0, "degrees"),
    "albedo": Key(_ALBEDO, [0.5, 0.5, 0.5]),
    "texture": Key(FileName((".png", ".jpg", ".jpeg"))),
    "ptm": Key(FileName((".ptm",))),
    "tile": Key(_LENGTH, 1.0, "m"),
    "reach": Key(_LENGTH, 100.0, "m"),
    "visible": Key(Flag(), True),
}
ROOM = {
    "environment": Key(MapName(MAP_SUFFIXES)),
    "sky": Key(Flag(), False),
    "shape": Key(Choice(SHAPES), "far"),
    "size": Key(Numbers(3, _LENGTH), None, "m"),
    "radius": Key(_LENGTH, None, "m"),
    "position": Key(Standing(), [0.0, 0.0], "m"),
    "yaw_deg": Key(_TURN, 0.0, "degrees"),
    "turn_deg": Key(_TURN, 0.0, "degrees/s"),
    "exposure": Key(Number(0, 1000), 1.0),
    "visible": Key(Flag(), True),
}
INSTANCE = {**_SUBJECT, **_PLACE, "scale": Key(_SCALE, 1.0)}
SCATTER = {
    **_SUBJECT,
    "count": Key(Whole(1, MOST_COPIES), REQUIRED),
    "rectangle": Key(Numbers(4), None, "m"),
    "circle": Key(Numbers(3), None, "m"),
    "polygon": Key(Corners(), None, "m"),
    "density": Key(FileName((".png",))),
    "minimum_distance": Key(Number(0, FARTHEST), 0.0, "m"),
    "max_slope_deg": Key(Number(0, 90), None, "degrees"),
    "seed": Key(Whole(0, 2**32 - 1), 0),
    "yaw_deg": Key(_TURN, None, "degrees"),
    "scale": Key(Range(_SCALE), [1.0, 1.0]),
}
MESH = {"model": Key(FileName(MODEL_SUFFIXES), REQUIRED), **_UP, **_PLACE, "scale": Key(_SCALE, 1.0)}
MESH |= _GLOSS | _REFLECTION
SURFACE = {
    "ptm": Key(FileName((".ptm",)), REQUIRED),
    "width": Key(_LENGTH, REQUIRED, "m"),
    "height": Key(_LENGTH, REQUIRED, "m"),
    **_PLACE,
    "pitch_deg": Key(Number(-90, 90), 0.0, "degrees"),
    "tiling": Key(Numbers(2, _SCALE), [1.0, 1.0]),
    **_GLOSS,
}
SCENE = {
    "ambient": Key(_LIGHT),
    "background": Key(_ALBEDO),
    "camera": Key(Table(CAMERA), REQUIRED),
    "light": Key(Tables(LIGHT, 1000), []),
    "sun": Key(Table(SUN)),
    "ground": Key(Table(GROUND)),
    "room": Key(Tables(ROOM, MOST_ROOMS), []),
    "shadow_lights": Key(Whole(0, 8), 2),
    "contact_shadow": Key(Number(0, 1)),
    "instance": Key(Tables(INSTANCE, 10_000), []),
    "scatter": Key(Tables(SCATTER, 256), []),
    "mesh": Key(Tables(MESH, 10_000), []),
    "surface": Key(Tables(SURFACE, 10_000), []),
}


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _digits(value: float) -> str:
    return f"{value:,.0f}" if value == round(value) else f"{value:g}"


def _either(words: Sequence[str]) -> str:
    return " or ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
