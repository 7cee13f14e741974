"""Who walks: an eye that turns and moves over the ground. Plain numbers, no window."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.views import direction
from runtime.viewing.cameras import Camera

MOVES = ("forward", "back", "left", "right", "up", "down", "sprint")
TURNS = ("turn left", "turn right", "turn up", "turn down")
STEEPEST = np.radians(89.0)
SPRINT = 4.0
TURN_RATE = np.radians(60.0)  # a second, by keys
SETTLING = 6.0  # a second: how fast the eye comes to its walking height, and back to it over uneven ground
CLEARANCE = 0.1  # metres that an eye in flight keeps above the ground
SLOWEST, FASTEST = 0.1, 1000.0


@dataclass
class Walker:
    """An eye and where it looks.

    Parameters
    ----------
    eye : ndarray, (3,) float64
        World space, metres.
    yaw, pitch : float
        Radians: azimuth and elevation of where it looks.
    speed : float
        Metres a second.
    flying : bool
        Moves where it looks, up and down too; else it keeps `walking_height` above the ground.
    ground_height : callable, optional
        Height of the ground at (x, z), metres. Without a ground every walker flies.
    walking_height : float
        Metres.
    """

    eye: NDArray[np.float64]
    yaw: float = 0.0
    pitch: float = 0.0
    speed: float = 3.0
    flying: bool = False
    ground_height: Callable[[float, float], float] | None = None
    walking_height: float = 1.7

    def __post_init__(self):
        self.eye = np.array(self.eye, float)

    def look_at(self, eye: ArrayLike, target: ArrayLike) -> None:
        """Stand at `eye` and look toward `target`, both (3,) float; what is too steep is made less so."""
        self.eye = np.array(eye, float)
        x, y, z = np.asarray(target, float) - self.eye
        level = float(np.hypot(x, z))
        if level > 0:
            self.yaw = float(np.arctan2(x, z))
        self.pitch = float(np.clip(np.arctan2(y, level), -STEEPEST, STEEPEST))

    @property
    def sight(self) -> NDArray[np.float64]:
        """The unit vector (3,) along which it looks."""
        return direction(self.yaw, self.pitch)

    def turn(self, right: float, up: float) -> None:
        """Turn the head, radians."""
        self.yaw = float((self.yaw - right + np.pi) % (2 * np.pi) - np.pi)
        self.pitch = float(np.clip(self.pitch + up, -STEEPEST, STEEPEST))

    def faster(self, steps: float) -> None:
        """Change the speed by a quarter a step; negative steps make it slower."""
        self.speed = float(np.clip(self.speed * 1.25**steps, SLOWEST, FASTEST))

    def step(self, held: Collection[str], seconds: float) -> None:
        """Move for some time.

        Parameters
        ----------
        held : collection of str
            Of `MOVES` and `TURNS`; opposites cancel.
        seconds : float
        """
        self.turn(
            _balance(held, "turn right", "turn left") * TURN_RATE * seconds,
            _balance(held, "turn up", "turn down") * TURN_RATE * seconds,
        )
        flies = self.flying or self.ground_height is None
        ahead = direction(self.yaw, self.pitch if flies else 0.0)
        right = np.cross(direction(self.yaw, 0.0), (0.0, 1.0, 0.0))
        way = _balance(held, "forward", "back") * ahead + _balance(held, "right", "left") * right
        if flies:
            way = way + _balance(held, "up", "down") * np.array([0.0, 1.0, 0.0])
        length = float(np.linalg.norm(way))
        if length > 1e-9:
            self.eye = self.eye + way * (self.speed * (SPRINT if "sprint" in held else 1.0) * seconds / length)
        self._stay_above_ground(flies, seconds)

    def _stay_above_ground(self, flies: bool, seconds: float) -> None:
        if self.ground_height is None:
            return
        ground = float(self.ground_height(self.eye[0], self.eye[2]))
        if flies:
            self.eye[1] = max(self.eye[1], ground + CLEARANCE)
        else:
            away = self.eye[1] - ground - self.walking_height
            self.eye[1] = ground + self.walking_height + away * np.exp(-SETTLING * seconds)

    def camera(self, fov_deg: float, aspect: float, near: float, far: float) -> Camera:
        """What it sees; parameters as `Camera.perspective`."""
        return Camera.perspective(self.eye, self.eye + self.sight, fov_deg, aspect, near, far)


def _balance(held: Collection[str], more: str, less: str) -> int:
    return (more in held) - (less in held)
