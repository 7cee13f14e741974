"""One picture of one object: a fan or its mesh, the same camera, lights and ground for both."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.environment import Reflection, Room
from impostor.errors import SettingsError, ViewWarning
from impostor.fan import Fan
from impostor.lighting import DirectionalLight, Gloss
from impostor.model import Model
from impostor.shadow_projection import Ground
from runtime.fans.leaning import FARTHEST_OFF_DEG
from runtime.gl.offscreen import Offscreen
from runtime.ground.ground_pass import GroundSurface
from runtime.lights.settings import DEFAULT_AMBIENT, DEFAULT_LIGHTS
from runtime.renderer import ImpostorRenderer
from runtime.viewing.cameras import Camera
from runtime.viewing.recentring import moved_camera, moved_room, recentred

OUTPUTS = ("lit", "albedo", "normal", "depth", "alpha")
MESH_SAMPLES = 4
GROUND_ALBEDO = (0.55, 0.54, 0.5)
GROUND_REACH = 12  # bounding radii


@dataclass(frozen=True)
class PictureSettings:
    """How to draw a picture.

    Parameters
    ----------
    width, height : int
        Pixels.
    lights, ambient
        As `ImpostorRenderer` takes them.
    gloss : Gloss
    rooms : sequence of Room
        What else lights it, and what it mirrors.
    reflection : Reflection, optional
    output : {"lit", "albedo", "normal", "depth", "alpha"}
        Only a lit picture has a ground. Depth is grey: white at the near end of the bounding sphere, black at its far
        end and where there is nothing.
    shadow : bool
        Whether a lit picture has a ground with the object's shadow on it.
    background : tuple of float
        sRGB and alpha, premultiplied.
    """

    width: int = 512
    height: int = 512
    lights: Sequence[DirectionalLight] = DEFAULT_LIGHTS
    ambient: ArrayLike = DEFAULT_AMBIENT
    gloss: Gloss = Gloss()  # noqa: RUF009 - frozen
    rooms: Sequence[Room] = ()
    reflection: Reflection | None = None
    output: str = "lit"
    shadow: bool = True
    background: tuple[float, float, float, float] = (0.72, 0.76, 0.80, 1.0)

    def __post_init__(self):
        if self.output not in OUTPUTS:
            raise SettingsError("output", f"{self.output!r}; expected one of {', '.join(OUTPUTS)}")


def orbit_camera(subject: Fan | Model, azimuth: float, elevation: float, aspect: float) -> Camera:
    """The orthographic camera that frames the object's bounding sphere; angles in radians."""
    return Camera.orthographic(subject.bounds.mean(axis=0), subject.radius, azimuth, elevation, aspect)


def eye_camera(subject: Fan | Model, eye: ArrayLike, target: ArrayLike | None, fov_deg: float, aspect: float) -> Camera:
    """A perspective camera, on the object's middle if no target is given; it sees the object and the ground around."""
    middle = subject.bounds.mean(axis=0)
    distance = float(np.linalg.norm(np.asarray(eye, float) - middle))
    near = max((distance - 1.1 * subject.radius) / 2, 0.01 * subject.radius)
    return Camera.perspective(
        eye, middle if target is None else target, fov_deg, aspect, near, distance + 2 * GROUND_REACH * subject.radius
    )


def draw_picture(
    ctx: moderngl.Context, subject: Fan | Model, camera: Camera, settings: PictureSettings
) -> NDArray[np.uint8]:
    """Draw a fan or a mesh.

    Parameters
    ----------
    ctx : moderngl.Context
    subject : Fan or Model
        The same call with the one or the other aligns to the pixel.
    camera : Camera
    settings : PictureSettings

    Returns
    -------
    ndarray, (H, W, 4) uint8
        sRGB, premultiplied; (H, W) for depth and alpha.

    Raises
    ------
    GpuError
        The GPU cannot hold a picture of that size.

    Warns
    -----
    ViewWarning
        A fan is seen from far above or below its views.
    """
    if isinstance(subject, Fan):
        _warn_of_elevation(subject, camera)
    subject, middle = recentred(subject)
    camera = moved_camera(camera, middle)
    target = Offscreen(ctx, settings.width, settings.height, MESH_SAMPLES if isinstance(subject, Model) else 1)
    renderer = ImpostorRenderer(ctx)
    try:
        renderer.lights, renderer.ambient = settings.lights, settings.ambient
        renderer.rooms = [moved_room(room, middle) for room in settings.rooms]
        add = renderer.add_mesh if isinstance(subject, Model) else renderer.add
        add(subject, gloss=settings.gloss, reflection=settings.reflection)  # type: ignore[arg-type]
        lit = settings.output == "lit"
        target.clear(settings.background if lit else (0.0, 0.0, 0.0, 0.0))
        if lit and settings.shadow:
            _draw_ground(renderer, subject, camera, settings)
            # Nothing of the object is under the ground: neither its feet nor what lies flat may fight with it.
            target.clear_depth()
        shown = settings.output if settings.output in ("albedo", "normal") else "lit"
        renderer.draw_meshes(*camera.matrices, shown)
        renderer.draw(*camera.matrices, shown)
        if settings.output == "depth":
            return _depth_picture(target.depth(), subject, camera)
        return target.color()[..., 3] if settings.output == "alpha" else target.color()
    finally:
        renderer.release()
        target.release()


def _warn_of_elevation(fan: Fan, camera: Camera) -> None:
    toward_eye = np.array([camera.toward_eye(fan.bounds.mean(axis=0))[1], *fan.views.basis[:, 2, 1]])
    seen, *views = np.degrees(np.arcsin(np.clip(toward_eye, -1, 1))).tolist()
    off = max(min(views) - seen, seen - max(views))
    if off > FARTHEST_OFF_DEG:
        found = f"{fan.name}: seen from an elevation of {seen:.3g} degrees, {off:.3g} away from its views"
        warnings.warn(
            ViewWarning(f"{found}; expected at most {FARTHEST_OFF_DEG:g}, or a fan baked there"), stacklevel=3
        )


def _draw_ground(renderer: ImpostorRenderer, subject: Fan | Model, camera: Camera, settings: PictureSettings) -> None:
    low, high = subject.bounds
    middle = (float((low[0] + high[0]) / 2), float(low[1]), float((low[2] + high[2]) / 2))
    ground = Ground(np.array([0.0, 1.0, 0.0]), low[1])
    if camera.toward_eye(np.array(middle))[1] <= 0:
        return
    reach = GROUND_REACH * subject.radius
    surface = GroundSurface(GROUND_ALBEDO, middle=middle, reach=reach, background=settings.background)
    renderer.draw_ground(*camera.matrices, ground, surface)
    renderer.draw_shadows(*camera.matrices, ground, surface)


def _depth_picture(depth: NDArray[np.float32], subject: Fan | Model, camera: Camera) -> NDArray[np.uint8]:
    ndc = depth.astype(float) * 2 - 1
    projection = camera.clip_from_view
    if projection[3, 3] == 1:
        z = (ndc - projection[2, 3]) / projection[2, 2]
    else:
        z = -projection[2, 3] / (ndc + projection[2, 2])
    middle = camera.view_from_world[:3] @ np.append(subject.bounds.mean(axis=0), 1.0)
    nearness = 0.5 + (z - middle[2]) / (2 * subject.radius)
    return np.rint(np.where(depth < 1, np.clip(nearness, 0, 1), 0) * 255).astype(np.uint8)
