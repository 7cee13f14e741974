"""The scene of the frame benchmarks: copies of one object on a ground, all about equally tall on the screen."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.fan import Fan
from impostor.lighting import DirectionalLight
from impostor.model import Model
from impostor.shadow_projection import Ground
from impostor.views import basis_facing, direction, rotation_about_y
from runtime.gl.offscreen import Offscreen
from runtime.renderer import ImpostorRenderer
from runtime.viewing.cameras import Camera
from runtime.viewing.viewer import Viewer

WIDTH, HEIGHT = 1280, 720
ELEVATION_DEG = 15.0
# A long lens keeps the objects at about one size.
FOV_DEG = 6.0
BACKGROUND = (0.4, 0.5, 0.6, 1.0)
HEIGHTS = {1: 400, 10: 200, 100: 60, 1000: 30}  # pixels, by number of objects
AMBIENT = 0.2


@dataclass(frozen=True)
class Placement:
    """Where the objects stand, and who looks at them.

    Parameters
    ----------
    positions : ndarray, (N, 3) float64
    yaws : ndarray, (N,) float64
    ground : Ground
    camera : Camera
    """

    positions: NDArray[np.float64]
    yaws: NDArray[np.float64]
    ground: Ground
    camera: Camera


def place(fan: Fan, count: int, pixels_high: int, seed: int = 1) -> Placement:
    """Spread objects over the whole picture, each turned another way.

    Parameters
    ----------
    fan : Fan
    count : int
    pixels_high : int
        Height on screen of an object in the middle of the picture.
    """
    generator = np.random.default_rng(seed)
    rectangles = fan.covered_rectangles
    texels_high = float(np.median(rectangles[:, 3] - rectangles[:, 1]))
    metres_high = texels_high / fan.size * 2 * float(fan.views.radius.mean())
    pixels_per_metre = pixels_high / metres_high
    focal = HEIGHT / 2 / np.tan(np.radians(FOV_DEG) / 2)
    eye_distance = focal / pixels_per_metre
    middle = fan.views.center.mean(axis=0)
    back = direction(0.0, np.radians(ELEVATION_DEG))
    eye = middle + back * eye_distance
    camera = Camera.perspective(eye, middle, FOV_DEG, WIDTH / HEIGHT, eye_distance / 10, eye_distance * 10)
    columns = max(round(np.sqrt(count * WIDTH / HEIGHT)), 1)
    rows = -(-count // columns)
    cells = np.stack(np.divmod(np.arange(count), columns)[::-1], axis=-1) + 0.5
    if count > 1:
        cells += generator.uniform(-0.25, 0.25, cells.shape)
    across = (cells / (columns, rows) * 2 - 1) * (WIDTH / HEIGHT, -1) * np.tan(np.radians(FOV_DEG) / 2)
    rays = np.column_stack([across, -np.ones(count)]) @ basis_facing(back)
    # Where each line of sight meets the plane through the objects' middles.
    positions = eye + rays * ((middle[1] - eye[1]) / rays[:, 1])[:, None] - middle
    lowest = float(middle[1] - metres_high / 2)
    return Placement(
        positions, generator.uniform(0, 2 * np.pi, count), Ground(np.array([0.0, 1.0, 0.0]), lowest), camera
    )


def lights(count: int, turn: float = 0.0) -> list[DirectionalLight]:
    """Lights from all around, as bright together as one; `turn` (radians) moves them all."""
    azimuths = np.degrees(turn) + 40 + 360 * np.arange(count) / count
    return [DirectionalLight.from_angles(azimuth, 45, np.full(3, 0.8 / count)) for azimuth in azimuths]


class Field:
    """A placement on the GPU, as fans.

    Parameters
    ----------
    ctx : moderngl.Context
    fan : Fan
    count, pixels_high : int
        See `place`.
    """

    def __init__(self, ctx: moderngl.Context, fan: Fan, count: int, pixels_high: int):
        self.ctx, self.count = ctx, count
        self.placement = place(fan, count, pixels_high)
        camera = self.placement.camera
        self.matrices = (camera.clip_from_view, camera.view_from_world)
        self.viewer = Viewer.from_matrices(*self.matrices, (0, 0, WIDTH, HEIGHT))
        self.target = Offscreen(ctx, WIDTH, HEIGHT)
        self.renderer = ImpostorRenderer(ctx)
        self.renderer.add(fan, self.placement.positions, self.placement.yaws)
        self.renderer.lights, self.renderer.ambient = lights(1), AMBIENT
        self._turn, self._shift = 0.0, 1e-3 * float(fan.views.radius.mean())

    def empty(self) -> None:
        """A frame of nothing."""
        self.target.clear(BACKGROUND)

    def impostors(self) -> None:
        """A frame of impostors; lights and viewer stand still."""
        self.target.clear(BACKGROUND)
        self.renderer.draw(*self.matrices)

    def impostors_and_shadows(self) -> None:
        """The same with their shadows."""
        self.target.clear(BACKGROUND)
        self.renderer.draw_shadows(*self.matrices, self.placement.ground)
        self.renderer.draw(*self.matrices)

    def impostors_relit(self) -> None:
        """A frame of impostors under lights that are another three degrees on: every tile is relit."""
        self._turn += 0.05
        self.renderer.lights = lights(len(self.renderer.lights), self._turn)
        self.impostors()

    def impostors_under_a_moving_sun(self) -> None:
        """A frame of impostors under lights that are a twentieth of a degree on."""
        self._turn += 0.001
        self.renderer.lights = lights(len(self.renderer.lights), self._turn)
        self.impostors()

    def impostors_moving(self) -> None:
        """A frame of impostors for a viewer who shifts a little from frame to frame."""
        self.target.clear(BACKGROUND)
        self.renderer.draw(*self.shifted_matrices())

    def impostors_and_shadows_moving(self) -> None:
        """The same with their shadows."""
        matrices = self.shifted_matrices()
        self.target.clear(BACKGROUND)
        self.renderer.draw_shadows(*matrices, self.placement.ground)
        self.renderer.draw(*matrices)

    def shifted_matrices(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The viewer's matrices a millimetre or so beside where they were the last time."""
        self._shift = -self._shift
        view_from_world = self.matrices[1].copy()
        view_from_world[0, 3] += self._shift
        return self.matrices[0], view_from_world

    def release(self) -> None:
        """Free everything on the GPU."""
        self.renderer.release()
        self.target.release()


class MeshField:
    """The same placement, as meshes.

    Parameters
    ----------
    field : Field
    model : Model
    """

    def __init__(self, field: Field, model: Model):
        self._field, self._renderer = field, ImpostorRenderer(field.ctx)
        self._renderer.lights, self._renderer.ambient = lights(1), AMBIENT
        matrices = np.tile(np.eye(4), (field.count, 1, 1))
        matrices[:, :3, :3] = rotation_about_y(field.placement.yaws)
        matrices[:, :3, 3] = field.placement.positions
        self._placed = [self._renderer.add_mesh(model, matrix) for matrix in matrices]

    def meshes(self, count: int) -> None:
        """A frame of the first `count` meshes without shadows."""
        self._renderer._placed.meshes = self._placed[:count]
        self._field.target.clear(BACKGROUND)
        self._renderer.draw_meshes(*self._field.matrices)

    def release(self) -> None:
        """Free everything on the GPU."""
        self._renderer._placed.meshes = self._placed
        self._renderer.release()
