"""What lights a scene, as a caller sets it on a renderer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.environment.room import Room
from impostor.errors import SettingsError
from impostor.lighting import DirectionalLight, LocalLight
from runtime.checks import check_type, numbers
from runtime.lights.contact_settings import ContactShadows
from runtime.lights.light_table import check_lights
from runtime.rooms.environments import check_rooms

DEFAULT_LIGHTS = (DirectionalLight.from_angles(40, 45, (0.75, 0.75, 0.75)),)
DEFAULT_AMBIENT = 0.25
DEFAULT_SHADOW_LIGHTS = 2


class LightSettings:
    """Lights, ambient light, rooms and their shadows, each checked when it is set."""

    def __init__(self):
        self.lights, self.ambient = DEFAULT_LIGHTS, DEFAULT_AMBIENT
        self.local_lights: Sequence[LocalLight] = ()
        self.rooms, self.shadow_lights, self.contact_shadows = (), DEFAULT_SHADOW_LIGHTS, None

    @property
    def lights(self) -> Sequence[DirectionalLight]:
        return self._lights

    @lights.setter
    def lights(self, lights: Sequence[DirectionalLight]) -> None:
        check_lights(lights)
        self._lights = lights

    @property
    def rooms(self) -> Sequence[Room]:
        return self._rooms

    @rooms.setter
    def rooms(self, rooms: Sequence[Room]) -> None:
        check_rooms(rooms)
        self._rooms = rooms

    @property
    def ambient(self) -> NDArray[np.float64]:
        return self._ambient

    @ambient.setter
    def ambient(self, ambient: ArrayLike) -> None:
        light = np.array(np.broadcast_to(numbers("ambient", "light", ambient, (), (3,)), (3,)))
        if np.any(light < 0):
            raise SettingsError("ambient", f"light goes down to {light.min():g}; expected at least 0")
        light.flags.writeable = False
        self._ambient = light

    @property
    def shadow_lights(self) -> int:
        return self._shadow_lights

    @shadow_lights.setter
    def shadow_lights(self, count: int) -> None:
        if isinstance(count, bool) or not isinstance(count, int | np.integer):
            raise SettingsError("shadow_lights", f"a {type(count).__name__}; expected an int")
        if count < 0:
            raise SettingsError("shadow_lights", f"{count}; expected a number of at least 0")
        self._shadow_lights = int(count)

    @property
    def contact_shadows(self) -> ContactShadows | None:
        return self._contact_shadows

    @contact_shadows.setter
    def contact_shadows(self, settings: ContactShadows | None) -> None:
        if settings is not None:
            check_type("contact_shadows", settings, ContactShadows)
        self._contact_shadows = settings
