"""The rooms of a scene: their environments, read or captured, and how they are turned."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.environment import Environment, Room
from impostor.scene import Scene, SceneRoom
from impostor.sky import sky_of
from impostor.sun import sun_at
from impostor.views import rotation_about_y
from runtime.rooms.capture import capture_environment
from runtime.stage.assets import Assets

CAPTURED_SIZE = 256  # texels along a face
NEAREST = 0.05  # metres

DrawScene = Callable[[NDArray[np.float64], NDArray[np.float64]], None]


class StageRooms:
    """Rooms of a scene, as a renderer takes them.

    Attributes
    ----------
    all : list of Room
    visible : list of Room
        Those whose walls, or sky, are drawn.
    """

    def __init__(self):
        self._described: Sequence[SceneRoom] = ()
        self._environments: list[Environment | None] = []
        self._yaws: tuple[float, ...] = ()
        self.all: list[Room] = []
        self.visible: list[Room] = []

    def change(self, scene: Scene, environments: list[Environment | None]) -> None:
        """Take over a scene's rooms and what `environments_of` found for them; captured ones come with `capture`."""
        self._described, self._environments = scene.rooms, environments
        azimuth = 0.0 if scene.sun is None else sun_at(scene.sun, scene.sun.time_of_day).azimuth
        self.turn([azimuth if room.sky else room.yaw for room in scene.rooms])

    def __len__(self) -> int:
        return len(self._described)

    def turn(self, yaws: Sequence[float], sky: Environment | None = None) -> None:
        """Turn all rooms by yaws in radians; those that are the sky show another one from now on, if it is given."""
        self._yaws = tuple(yaws)
        if sky is not None:
            skies = [room.sky for room in self._described]
            self._environments = [
                sky if is_sky else each for each, is_sky in zip(self._environments, skies, strict=True)
            ]
        self.all, self.visible = [], []
        for environment, described, yaw in zip(self._environments, self._described, yaws, strict=True):
            if environment is not None:
                room = described.around(environment, yaw)
                self.all.append(room)
                if described.visible:
                    self.visible.append(room)

    @property
    def uncaptured(self) -> bool:
        """Whether a room still waits for what is seen from its middle."""
        return None in self._environments

    def capture(self, ctx: moderngl.Context, draw: DrawScene, far: Callable[[NDArray[np.float64]], float]) -> None:
        """Fill the rooms that have no map with what is seen from their middles.

        Parameters
        ----------
        ctx : moderngl.Context
        draw : callable
            Draws the scene without what mirrors, with `clip_from_view` and `view_from_world`, into the bound
            framebuffer.
        far : callable
            Metres to the far plane, for an eye (3,).
        """
        for number, described in enumerate(self._described):
            if self._environments[number] is None:
                eye, turn = np.array(described.position), rotation_about_y(described.yaw).T
                self._environments[number] = capture_environment(ctx, draw, eye, CAPTURED_SIZE, NEAREST, far(eye), turn)
        self.turn(self._yaws)

    def corners(self) -> NDArray[np.float64]:
        """Of cubes around all rooms of some size, however they turn, (K, 3), world space."""
        unit = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        found = [
            room.position + unit * np.linalg.norm(room.size) / 2 for room in self._described if room.shape != "far"
        ]
        return np.concatenate(found) if found else np.empty((0, 3))


def environments_of(scene: Scene, assets: Assets) -> list[Environment | None]:
    """What each room of a scene shows; None for those that are to be captured.

    Raises
    ------
    EnvironmentFileError
    """
    maps = [None if room.environment is None else assets.environment(room.environment) for room in scene.rooms]
    sky = sky_of(scene) if any(room.sky for room in scene.rooms) else None
    return [sky if room.sky else each for room, each in zip(scene.rooms, maps, strict=True)]
