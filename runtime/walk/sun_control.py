"""Time in a walk: the sun goes on and rooms turn; and both can be dragged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from impostor.environment import Environment
from impostor.lighting import DirectionalLight
from impostor.scene import Scene, SceneRoom
from impostor.sky import sky_of
from impostor.sun import Daylight, Lighting, lighting_at, sun_at
from impostor.views import direction

USUAL_RATE = 0.5  # hours a second, where the scene does not say
HOURS_A_TURN = 24 / (2 * np.pi)
HIGHEST = np.radians(89.0)


class SunControl:
    """What a scene is lit by, as time goes on and sun and surroundings are dragged about.

    Parameters
    ----------
    scene : Scene

    Attributes
    ----------
    running : bool
        Whether time goes on.
    """

    def __init__(self, scene: Scene):
        self._scene = scene
        self.reset()

    def reset(self) -> None:
        """Begin as the scene does."""
        sun = self._scene.sun
        self._hours = 12.0 if sun is None else sun.time_of_day
        self._north = 0.0 if sun is None else sun.north
        self._lights = self._scene.lights
        self._seconds, self._dragged = 0.0, 0.0
        self.running = (sun is not None and sun.hours_per_second != 0) or self._rooms_turn

    def change(self, scene: Scene, parts: frozenset[str]) -> None:
        """Go on in another scene, which differs in some parts: from its beginning where its light is another."""
        self._scene = scene
        if parts & {"sun", "lights", "rooms"}:
            self.reset()

    @property
    def has_time(self) -> bool:
        """Whether there is anything that goes with time: a sun, or a room that turns."""
        return self._scene.sun is not None or self._rooms_turn

    @property
    def _rooms_turn(self) -> bool:
        return any(room.turn != 0 for room in self._scene.rooms)

    @property
    def room_yaws(self) -> tuple[float, ...]:
        """How the scene's rooms are turned, radians; the sky with the sun."""
        sun = self._now.sun
        azimuth = 0.0 if sun is None else sun_at(sun, self._hours).azimuth
        return tuple(azimuth if room.sky else self._yaw(room) for room in self._scene.rooms)

    def _yaw(self, room: SceneRoom) -> float:
        return room.yaw + room.turn * self._seconds + (self._dragged if room.shape == "far" else 0.0)

    @property
    def sky(self) -> Environment | None:
        """What rooms show that are the sky."""
        return sky_of(self._now) if any(room.sky for room in self._scene.rooms) else None

    def step(self, seconds: float) -> None:
        """Let time go on, if it does."""
        if self.running:
            self._seconds += seconds
            if self._scene.sun is not None:
                self.turn_clock(seconds * (self._scene.sun.hours_per_second or USUAL_RATE))

    def turn_clock(self, hours: float) -> None:
        """Move the sun along its own way."""
        self._hours = (self._hours + hours) % 24.0

    def drag(self, right: float, up: float) -> None:
        """Pull the sun, or where there is none the first light, sideways and up; far rooms turn sideways with it.

        The sun rises as the day does, to noon and no further; sideways its whole way turns.

        Parameters
        ----------
        right, up : float
            Radians.
        """
        self._dragged -= right
        if self._scene.sun is not None:
            self._north -= right
            afternoon = self._hours >= 12
            hours = self._hours + up * HOURS_A_TURN * (-1 if afternoon else 1)
            self._hours = float(np.clip(hours, 12.0, 23.999) if afternoon else np.clip(hours, 0.0, 11.999))
        elif self._lights:
            first, *others = self._lights
            x, y, z = first.toward
            azimuth, elevation = np.arctan2(x, z) - right, np.arcsin(np.clip(y, -1, 1)) + up
            x, y, z = direction(azimuth, np.clip(elevation, -HIGHEST, HIGHEST)).tolist()
            self._lights = (DirectionalLight((x, y, z), first.color), *others)

    @property
    def lighting(self) -> Lighting:
        """All light of the scene as it is now."""
        return lighting_at(self._now)

    @property
    def _now(self) -> Scene:
        """The scene, its sun or its lights as they are now."""
        scene = self._scene
        if scene.sun is not None:
            return replace(scene, sun=replace(scene.sun, time_of_day=self._hours, north=self._north))
        return replace(scene, lights=self._lights)

    @property
    def words(self) -> str:
        """Time and place of the sun, for people."""
        if self._scene.sun is None:
            return "still"
        now: Daylight = sun_at(replace(self._scene.sun, north=self._north), self._hours)
        minutes = round(self._hours * 60) % 1440
        place = f"azimuth {np.degrees(now.azimuth):.0f}, elevation {np.degrees(now.elevation):.0f} degrees"
        return f"{minutes // 60:02d}:{minutes % 60:02d}, {place}"
