"""Scenes: what stands where, under which light, seen from where. Plain data, made by `load_scene`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impostor.environment import Environment, Reflection, Room
from impostor.lighting import DirectionalLight, Gloss
from impostor.shadow_projection import Ground
from impostor.views import rotation_about_y

Vector = tuple[float, float, float]
PARTS = (
    "camera",
    "lights",
    "sun",
    "ambient",
    "background",
    "ground",
    "rooms",
    "shadow_lights",
    "contact_shadow",
    "instances",
    "meshes",
    "surfaces",
)
"""The fields of a scene that can change one without the other."""


@dataclass(frozen=True)
class BakeSettings:
    """What a model's fan is baked with, under the names that `bake_fan` takes.

    Parameters
    ----------
    views : int
    elevation_deg : float or None
        Degrees; of a ring only.
    layout : {"ring", "hemisphere", "sphere"}
    size : int
        Side of a tile in texels.
    samples : int or None
        Along a texel's side; None leaves it to the bake.
    up : {"y", "z"}
        The model file's up axis.
    """

    views: int = 96
    elevation_deg: float | None = 15.0
    layout: str = "ring"
    size: int = 256
    samples: int | None = None
    up: str = "y"


@dataclass(frozen=True)
class Subject:
    """What an instance shows. Equal subjects are one fan.

    Parameters
    ----------
    fan : Path
        The fan file. Where `bake` is given it may not exist yet.
    model : Path or None
        The mesh that the fan shows.
    up : {"y", "z"}
        The model file's up axis.
    bake : BakeSettings or None
        With what to bake `model` into `fan` when that does not exist; None when the scene names the fan itself.
    """

    fan: Path
    model: Path | None = None
    up: str = "y"
    bake: BakeSettings | None = None


@dataclass(frozen=True, eq=False)
class Placement:
    """All copies of one subject that shine and mirror alike: the arrays that `ImpostorRenderer.add` takes.

    Parameters
    ----------
    subject : Subject
    positions : ndarray, (N, 3) float64
        World space, metres.
    yaws : ndarray, (N,) float64
        Radians about +Y.
    scales : ndarray, (N,) float64
    gloss : Gloss
    lod : bool
        Draw the mesh near and the fan far; the subject then has a model.
    reflection : Reflection or None
    """

    subject: Subject
    positions: NDArray[np.float64]
    yaws: NDArray[np.float64]
    scales: NDArray[np.float64]
    gloss: Gloss = field(default_factory=Gloss)
    lod: bool = False
    reflection: Reflection | None = None

    def __len__(self) -> int:
        return len(self.positions)


@dataclass(frozen=True)
class SceneMesh:
    """A model that is always drawn as a mesh. Metres and radians; `up` is the file's up axis."""

    model: Path
    up: str = "y"
    position: Vector = (0.0, 0.0, 0.0)
    yaw: float = 0.0
    scale: float = 1.0
    gloss: Gloss = field(default_factory=Gloss)
    reflection: Reflection | None = None

    @property
    def world_from_model(self) -> NDArray[np.float64]:
        """(4, 4) float64."""
        return _placed(rotation_about_y(self.yaw) * self.scale, self.position)


@dataclass(frozen=True)
class SceneSurface:
    """A rectangle that a PTM is laid on: a wall, a floor, a relief.

    Parameters
    ----------
    ptm : Path
    width, height : float
        Metres.
    position : tuple of float
        Of its middle.
    yaw, pitch : float
        Radians: azimuth and elevation of the direction that it faces.
    tiling : tuple of float
        How often the picture repeats along width and height.
    gloss : Gloss
    """

    ptm: Path
    width: float
    height: float
    position: Vector = (0.0, 0.0, 0.0)
    yaw: float = 0.0
    pitch: float = 0.0
    tiling: tuple[float, float] = (1.0, 1.0)
    gloss: Gloss = field(default_factory=Gloss)

    @property
    def world_from_model(self) -> NDArray[np.float64]:
        """(4, 4) float64: places a rectangle around the origin that faces +Z."""
        cos, sin = np.cos(self.pitch), np.sin(self.pitch)
        pitch = np.array([[1, 0, 0], [0, cos, sin], [0, -sin, cos]])
        return _placed(rotation_about_y(self.yaw) @ pitch, self.position)


@dataclass(frozen=True)
class SceneRoom:
    """Light from all around, with a place and a size.

    Parameters
    ----------
    environment : Path or None
        A panorama, or a folder of six faces; None is captured in the scene itself, from the room's middle, unless it
        is the sky.
    shape : {"far", "sphere", "box"}
    size : tuple of float
        Width, height and depth in metres; what is far has none.
    position : tuple of float
        Of its middle.
    yaw : float
        Radians.
    turn : float
        By how much it turns in a second, radians.
    exposure : float
        Multiplies its light.
    visible : bool
        Whether its walls are drawn, or the sky that a far one is.
    sky : bool
        The clear sky of the scene's sun, far away: `impostor.sky.sky_of`.
    """

    environment: Path | None
    shape: str = "far"
    size: Vector = (1.0, 1.0, 1.0)
    position: Vector = (0.0, 0.0, 0.0)
    yaw: float = 0.0
    turn: float = 0.0
    exposure: float = 1.0
    visible: bool = True
    sky: bool = False

    def around(self, environment: Environment, yaw: float) -> Room:
        """The room with what it shows, turned by a yaw in radians."""
        matrix = _placed(rotation_about_y(yaw) * np.divide(self.size, 2), self.position)
        return Room(environment, self.shape, matrix, exposure=self.exposure)


@dataclass(frozen=True)
class SceneGround:
    """The plane that everything stands on, and what it looks like.

    Parameters
    ----------
    height : float
        Metres, at x = z = 0.
    tilt : float
        Radians from level.
    tilt_azimuth : float
        Radians; the direction in which the ground falls.
    albedo : tuple of float
        Linear; multiplies the texture.
    texture, ptm : Path or None
        At most one of them; it repeats every `tile` metres.
    tile : float
    reach : float
        Metres to where the ground has faded out.
    visible : bool
        Whether it is drawn; else only shadows are, on whatever is there.
    """

    height: float = 0.0
    tilt: float = 0.0
    tilt_azimuth: float = 0.0
    albedo: Vector = (0.5, 0.5, 0.5)
    texture: Path | None = None
    ptm: Path | None = None
    tile: float = 1.0
    reach: float = 100.0
    visible: bool = True

    @property
    def plane(self) -> Ground:
        """The plane as shadows take it."""
        sin, cos = np.sin(self.tilt), np.cos(self.tilt)
        normal = np.array([sin * np.sin(self.tilt_azimuth), cos, sin * np.cos(self.tilt_azimuth)])
        return Ground(normal, self.height * cos)

    def heights(self, x: Any, z: Any) -> NDArray[np.float64]:
        """Height of the ground at x and z, all in metres and of one shape."""
        away = np.multiply(x, np.sin(self.tilt_azimuth)) + np.multiply(z, np.cos(self.tilt_azimuth))
        return self.height - np.tan(self.tilt) * away


@dataclass(frozen=True, eq=False)
class CameraPath:
    """A flight: where the camera is at given times. `impostor.camera_path.camera_at` gives what lies between.

    Parameters
    ----------
    times : ndarray, (K,) float64
        Seconds, rising.
    eyes, targets : ndarray, (K, 3) float64
        World space; never equal.
    """

    times: NDArray[np.float64]
    eyes: NDArray[np.float64]
    targets: NDArray[np.float64]

    @property
    def duration(self) -> float:
        """Seconds from the first key to the last."""
        return float(self.times[-1] - self.times[0])


@dataclass(frozen=True, eq=False)
class SceneCamera:
    """Where the viewer begins.

    Parameters
    ----------
    eye, target : tuple of float
        World space; not equal.
    fov_deg : float
        Vertical field of view in degrees.
    near, far : float or None
        Metres; None leaves it to the viewer.
    walking_height : float
        Of the eye over the ground while walking, metres.
    path : CameraPath or None
    """

    eye: Vector
    target: Vector
    fov_deg: float = 50.0
    near: float | None = None
    far: float | None = None
    walking_height: float = 1.7
    path: CameraPath | None = None


@dataclass(frozen=True)
class Sun:
    """Where the sun is, and how fast the day goes. `impostor.sun.sun_at` gives its light.

    Parameters
    ----------
    time_of_day : float
        Hours of solar time when the scene begins: 12 is noon.
    latitude : float
        Radians, north positive.
    day_of_year : int
        1 to 365.
    north : float
        Radians; azimuth of north.
    hours_per_second : float
        0 stands still, negative runs backward.
    color : tuple of float
        Linear light of the sun in the zenith.
    skylight : float
        Part of the sky's colour that reaches every normal.
    """

    time_of_day: float = 12.0
    latitude: float = np.radians(45.0)
    day_of_year: int = 172
    north: float = np.pi
    hours_per_second: float = 0.0
    color: Vector = (1.0, 1.0, 1.0)
    skylight: float = 0.5


@dataclass(frozen=True, eq=False)
class Scene:
    """A whole scene. All colours are linear, all arrays read-only.

    Parameters
    ----------
    path : Path
        Its file.
    camera : SceneCamera
    lights : tuple of DirectionalLight
        Those that stand still; `impostor.sun.lighting_at` adds the sun.
    sun : Sun or None
    ambient : tuple of float
        Light that reaches every normal, the sky's not counted.
    background : tuple of float or None
        None is the colour of the sky.
    ground : SceneGround or None
    rooms : tuple of SceneRoom
    shadow_lights : int
        How many of the brightest lights of a room cast shadows.
    contact_shadow : float
        0 to 1: how dark the ambient light is right under what stands on the ground.
    instances : tuple of Placement
        One for each subject that shines alike.
    meshes : tuple of SceneMesh
    surfaces : tuple of SceneSurface
    files : mapping of Path to frozenset of str
        Every file that the scene depends on, and the parts that are made of it; the scene's own file has none.
    """

    path: Path
    camera: SceneCamera
    lights: tuple[DirectionalLight, ...] = ()
    sun: Sun | None = None
    ambient: Vector = (0.0, 0.0, 0.0)
    background: Vector | None = None
    ground: SceneGround | None = None
    rooms: tuple[SceneRoom, ...] = ()
    shadow_lights: int = 2
    contact_shadow: float = 0.0
    instances: tuple[Placement, ...] = ()
    meshes: tuple[SceneMesh, ...] = ()
    surfaces: tuple[SceneSurface, ...] = ()
    files: Mapping[Path, frozenset[str]] = field(default_factory=dict)


def changed_parts(old: Scene, new: Scene) -> frozenset[str]:
    """Names of the `PARTS` in which two scenes differ."""
    return frozenset(part for part in PARTS if not _same(getattr(old, part), getattr(new, part)))


def _same(one: Any, other: Any) -> bool:
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    if is_dataclass(one):
        return all(_same(getattr(one, each.name), getattr(other, each.name)) for each in fields(one))
    return one == other


def _placed(linear: NDArray[np.float64], position: Vector) -> NDArray[np.float64]:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, position
    return matrix
