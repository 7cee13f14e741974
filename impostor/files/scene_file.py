"""Reading scene files. SCENE.md, beside this file, is the normative text."""

from __future__ import annotations

import math
import warnings
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from impostor.environment import Reflection
from impostor.errors import SceneFileError, SceneWarning, SettingsError
from impostor.files.baked_fans import baked_fan_path, model_files
from impostor.files.scene_document import Document
from impostor.files.scene_schema import BAKE, MOST_COPIES, SCENE
from impostor.files.toml_lines import Place
from impostor.lighting import DirectionalLight, Gloss
from impostor.scatter import Area, Circle, Polygon, Rectangle, scatter_points
from impostor.scene import (
    BakeSettings,
    CameraPath,
    Placement,
    Scene,
    SceneCamera,
    SceneGround,
    SceneMesh,
    SceneRoom,
    SceneSurface,
    Subject,
    Sun,
    Vector,
)

MOST_TEXELS = 1 << 22
DEFAULT_LIGHT = DirectionalLight.from_angles(40, 45, (0.75, 0.75, 0.75))
DEFAULT_AMBIENT = (0.25, 0.25, 0.25)
AREAS = ("rectangle", "circle", "polygon")
Table = dict[str, Any]
Kind = tuple[Subject, Gloss, bool, Reflection | None]


def load_scene(path: str | PathLike[str]) -> Scene:
    """Read a scene.

    Parameters
    ----------
    path : path-like
        A TOML file; its relative paths lead from its own folder.

    Returns
    -------
    Scene
        Every file that it names exists, but for the fans that are to be baked on demand.

    Raises
    ------
    SceneFileError
        The file breaks a rule of SCENE.md: file, line, key, value and what was expected, on one line.

    Warns
    -----
    SceneWarning
        An area has no room for all the copies that were to be strewn there.
    """
    return read_scene(Document(path))


def read_scene(document: Document) -> Scene:
    """As `load_scene`; the document's `sought` files are known also where this fails."""
    return _Reader(document).scene()


class _Reader:
    """Makes a scene of one document, and notes which files each part needs."""

    def __init__(self, document: Document):
        self.document = document
        self.files: dict[Path, set[str]] = {path: set() for path in document.sought}
        self.ground: SceneGround | None = None
        self.copies: dict[Kind, list[tuple[NDArray[np.float64], ...]]] = {}
        self.asked = 0  # copies so far, with or without room

    def scene(self) -> Scene:
        values = self.document.read(SCENE)
        sun, lights = values["sun"], tuple(map(_light, values["light"]))
        dark = sun is None and not lights and not values["room"]
        self.ground = self._ground(values["ground"])
        camera = self._camera(values["camera"])
        for index, table in enumerate(values["instance"]):
            self._instance(table, ("instance", index))
        for index, table in enumerate(values["scatter"]):
            self._scatter(table, ("scatter", index))
        meshes = tuple(self._mesh(table, ("mesh", index)) for index, table in enumerate(values["mesh"]))
        surfaces = tuple(map(self._surface, values["surface"]))
        rooms = tuple(self._room(table, ("room", index), sun) for index, table in enumerate(values["room"]))
        ambient = values["ambient"] or ((0.0, 0.0, 0.0) if sun or rooms else DEFAULT_AMBIENT)
        return Scene(
            self.document.path,
            camera,
            (DEFAULT_LIGHT,) if dark else lights,
            _sun(sun),
            ambient,
            values["background"],
            self.ground,
            rooms,
            values["shadow_lights"],
            (1.0 if rooms else 0.0) if values["contact_shadow"] is None else values["contact_shadow"],
            tuple(_placement(key, parts) for key, parts in self.copies.items()),
            meshes,
            surfaces,
            {path: frozenset(parts) for path, parts in self.files.items()},
        )

    def _note(self, part: str, *paths: Path | None) -> None:
        for path in paths:
            if path is not None:
                self.document.sought.add(path)
                self.files.setdefault(path, set()).add(part)

    def _ground(self, table: Table | None) -> SceneGround | None:
        if table is None:
            return None
        if table["texture"] and table["ptm"]:
            raise self.document.error(("ground", "ptm"), "a texture or a PTM, not both")
        self._note("ground", table["texture"], table["ptm"])
        tilt, azimuth = (math.radians(table.pop(key)) for key in ("tilt_deg", "tilt_azimuth_deg"))
        return SceneGround(tilt=tilt, tilt_azimuth=azimuth, **table)

    def _standing(self, position: tuple[float, ...], over: float = 0.0) -> Vector:
        """Three coordinates; of two, `over` metres over the ground."""
        if len(position) == 3:
            return position
        x, z = position
        return x, (float(self.ground.heights(x, z)) if self.ground else 0.0) + over, z

    def _camera(self, table: Table) -> SceneCamera:
        height, keys = table["walking_height"], table.pop("path")
        path = None if keys is None else self._path(keys, height)
        for name, first in (("eye", path and path.eyes[0]), ("target", path and path.targets[0])):
            if table[name] is None:
                if first is None:
                    raise self.document.error(("camera", name), "it, or a [[camera.path]]", "is missing")
                table[name] = tuple(first.tolist())
        table["eye"] = self._standing(table["eye"], height)
        if math.dist(table["eye"], table["target"]) < 1e-6:
            raise self.document.error(("camera", "target"), "another point than the eye")
        near, far = table["near"], table["far"]
        if near is not None and far is not None and not near < far:
            raise self.document.error(("camera", "far"), f"more than near, {near:g}")
        return SceneCamera(path=path, **table)

    def _path(self, keys: list[Table], height: float) -> CameraPath:
        if len(keys) < 2:
            raise self.document.error(("camera", "path"), "at least 2", f"{len(keys)} keys")
        eyes = [self._standing(key["eye"], height) for key in keys]
        for index, (key, eye) in enumerate(zip(keys, eyes, strict=True)):
            if index and key["time"] <= keys[index - 1]["time"]:
                before = keys[index - 1]["time"]
                raise self.document.error(("camera", "path", index, "time"), f"more than the key before, {before:g}")
            if math.dist(eye, key["target"]) < 1e-6:
                raise self.document.error(("camera", "path", index, "target"), "another point than the eye")
        columns = [key["time"] for key in keys], eyes, [key["target"] for key in keys]
        return CameraPath(*map(_frozen, columns))

    def _subject(self, table: Table, place: Place) -> Kind:
        fan, model, lod, up = table["fan"], table["model"], table["lod"], table["up"]
        if lod and model is None:
            raise self.document.error((*place, "lod"), "a model beside it")
        if fan is not None and model is not None and not lod:
            raise self.document.error((*place, "model"), "lod = true beside a fan and a model, or one of them")
        if fan is not None and table["bake"] is not None:
            raise self.document.error((*place, "bake"), "none, since the fan is baked", "a table")
        if model is not None:
            self._note_model("instances", model, place)
        if fan is not None:
            self._note("instances", fan)
            subject = Subject(fan, model, up)
        elif model is not None:
            subject = self._baked(model, self._bake(table["bake"], up, (*place, "bake")), place)
        else:
            raise self.document.error(place, "fan or model", "no subject")
        return subject, Gloss(table["gloss"], table["shininess"]), lod, _reflection(table["reflection"])

    def _bake(self, table: Table | None, up: str, place: Place) -> BakeSettings:
        values = table or {name: key.default for name, key in BAKE.items()}
        ring = values["layout"] == "ring"
        if values["elevation_deg"] is None:
            values["elevation_deg"] = BakeSettings.elevation_deg if ring else None
        elif not ring:
            raise self.document.error((*place, "elevation_deg"), "it of a ring only")
        return BakeSettings(up=up, **values)

    def _baked(self, model: Path, settings: BakeSettings, place: Place) -> Subject:
        try:
            return Subject(baked_fan_path(self.document.folder, model, settings), model, settings.up, settings)
        except OSError as error:
            raise self._unreadable(error, place) from None

    def _note_model(self, part: str, model: Path, place: Place) -> None:
        try:
            self._note(part, *model_files(model))
        except OSError as error:
            raise self._unreadable(error, place) from None

    def _unreadable(self, error: OSError, place: Place) -> SceneFileError:
        found = f"{Path(error.filename or '').name!r} cannot be read: {error.strerror}"
        return self.document.error((*place, "model"), "a model that can be", found)

    def _add(self, key: Kind, *arrays: NDArray[np.float64]) -> None:
        self.copies.setdefault(key, []).append(arrays)

    def _instance(self, table: Table, place: Place) -> None:
        position = self._standing(table["position"])
        yaw = math.radians(table["yaw_deg"])
        self._add(self._subject(table, place), *map(np.array, ([position], [yaw], [table["scale"]])))

    def _scatter(self, table: Table, place: Place) -> None:
        key, count, seed = self._subject(table, place), table["count"], table["seed"]
        self.asked += count
        if self.asked > MOST_COPIES:
            found = f"{self.asked:,} copies strewn up to here"
            raise self.document.error((*place, "count"), f"at most {MOST_COPIES:,}", found)
        slope = table["max_slope_deg"]
        if slope is not None and self.ground and math.radians(slope) < self.ground.tilt:
            tilt = math.degrees(self.ground.tilt)
            raise self.document.error((*place, "max_slope_deg"), f"at least {tilt:g}, the tilt of the whole ground")
        area = self._area(table, place)
        density = self._density(table["density"], (*place, "density"))
        try:
            points = scatter_points(area, count, seed, table["minimum_distance"], density)
        except SettingsError as error:
            raise self.document.problem((*place, "density"), error.problem) from None
        if len(points) < count:
            self._warn((*place, "count"), f"{count:,} copies; {len(points):,} of them found room")
        x, z = points.T
        y = self.ground.heights(x, z) if self.ground else np.zeros_like(x)
        yaw, (low, high) = table["yaw_deg"], table["scale"]
        # Streams of their own: another range of scales turns no copy and moves none.
        yaws, scales = (np.random.default_rng([seed, stream]).random(len(points)) for stream in (1, 2))
        yaws = 2 * np.pi * yaws if yaw is None else np.full(len(points), math.radians(yaw))
        self._add(key, np.stack([x, y, z], axis=-1), yaws, low + (high - low) * scales)

    def _area(self, table: Table, place: Place) -> Area:
        given = [name for name in AREAS if table[name] is not None]
        if len(given) != 1:
            found = " and ".join(given) or "no area"
            raise self.document.error(place if not given else (*place, given[1]), f"one of {', '.join(AREAS)}", found)
        (name,) = given
        try:
            if name == "rectangle":
                return Rectangle(*table[name])
            return Circle(*table[name]) if name == "circle" else Polygon(table[name])
        except SettingsError as error:
            raise self.document.problem((*place, name), error.problem) from None

    def _density(self, path: Path | None, place: Place) -> NDArray[np.float64] | None:
        """A PNG's grey values (H, W)."""
        if path is None:
            return None
        self._note("instances", path)
        expected = f"a PNG of at most {MOST_TEXELS:,} texels"
        try:
            with warnings.catch_warnings(), Image.open(path, formats=["PNG"]) as image:
                warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # the next line is stricter
                if image.width * image.height > MOST_TEXELS:
                    found = f"{image.width} x {image.height} texels"
                    raise self.document.error(place, expected, found)
                wide = image.mode.startswith("I")
                return np.asarray(image if wide else image.convert("L"), float)
        except (OSError, ValueError, SyntaxError):
            raise self.document.error(place, "a PNG that can be read") from None
        except Image.DecompressionBombError:
            raise self.document.error(place, expected) from None

    def _mesh(self, table: Table, place: Place) -> SceneMesh:
        self._note_model("meshes", table["model"], place)
        return SceneMesh(
            table["model"],
            table["up"],
            self._standing(table["position"]),
            math.radians(table["yaw_deg"]),
            table["scale"],
            Gloss(table["gloss"], table["shininess"]),
            _reflection(table["reflection"]),
        )

    def _surface(self, table: Table) -> SceneSurface:
        self._note("surfaces", table["ptm"])
        width, height, pitch = table["width"], table["height"], math.radians(table["pitch_deg"])
        return SceneSurface(
            table["ptm"],
            width,
            height,
            self._standing(table["position"], height / 2 * math.cos(pitch)),
            math.radians(table["yaw_deg"]),
            pitch,
            table["tiling"],
            Gloss(table["gloss"], table["shininess"]),
        )

    def _room(self, table: Table, place: Place, sun: Table | None) -> SceneRoom:
        self._note("rooms", table["environment"])
        shape, wanted = table["shape"], {"far": None, "sphere": "radius", "box": "size"}[table["shape"]]
        for name in ("size", "radius"):
            if (table[name] is None) == (name == wanted):
                expected = f"one with {shape!r}" if name == wanted else f"none with {shape!r}"
                raise self.document.error((*place, name), expected)
        width, height, depth = table["size"] or [2 * (table["radius"] or 1.0)] * 3
        if table["sky"]:
            if shape != "far":
                raise self.document.error((*place, "sky"), "it of a room that is far only", f"it with {shape!r}")
            if table["environment"] is not None:
                raise self.document.error((*place, "environment"), "none with sky = true")
            if sun is None:
                raise self.document.error((*place, "sky"), "a [sun] in the scene", "none")
        elif shape == "far" and table["environment"] is None:
            raise self.document.error((*place, "environment"), "one with 'far', or sky = true")
        return SceneRoom(
            table["environment"],
            shape,
            (width, height, depth),
            self._standing(table["position"], height / 2 if shape != "far" else 0.0),
            math.radians(table["yaw_deg"]),
            math.radians(table["turn_deg"]),
            table["exposure"],
            table["visible"],
            table["sky"],
        )

    def _warn(self, place: Place, problem: str) -> None:
        text = f"{self.document.path}: {self.document.where(place)}: {problem}"
        warnings.warn(SceneWarning(text), stacklevel=2)


def _light(table: Table) -> DirectionalLight:
    return DirectionalLight.from_angles(table["azimuth_deg"], table["elevation_deg"], table["color"])


def _reflection(table: Table | None) -> Reflection | None:
    return None if table is None else Reflection(**table)


def _sun(table: Table | None) -> Sun | None:
    if table is None:
        return None
    latitude, north = (math.radians(table.pop(key)) for key in ("latitude_deg", "north_deg"))
    return Sun(latitude=latitude, north=north, **table)


def _placement(key: Kind, parts: list[tuple[NDArray[np.float64], ...]]) -> Placement:
    positions, yaws, scales = (_frozen(np.concatenate(arrays)) for arrays in zip(*parts, strict=True))
    subject, gloss, lod, reflection = key
    return Placement(subject, positions, yaws, scales, gloss, lod, reflection)


def _frozen(values: Any) -> NDArray[np.float64]:
    array = np.array(values, np.float64)
    array.flags.writeable = False
    return array
