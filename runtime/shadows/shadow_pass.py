"""The shadow pass: strips of fans and triangles of meshes, marked where they fall and taken from the light once."""

from __future__ import annotations

from collections.abc import Iterable

import moderngl

from impostor.fan import Fan
from runtime.gl.state import CallerState
from runtime.ground.ground_light import BrightLights, ground_light
from runtime.ground.ground_pass import GroundSurface
from runtime.lights.settings import LightSettings
from runtime.shadows.casters import Casting, casters_for
from runtime.shadows.darkening import MOST_LIGHTS, DarkeningPass
from runtime.shadows.marks import CHANNELS, Mark, MarkPass, Marks
from runtime.shadows.receiver import Receiver
from runtime.viewing.viewer import Viewer


class ShadowPass:
    """Darkens the ground, and flat surfaces, where lights do not reach them.

    Parameters
    ----------
    ctx : moderngl.Context
    """

    memory_kind = "shadow marks"

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self._mark_pass, self._darkening = MarkPass(ctx), DarkeningPass(ctx)
        self._marks: dict[int | None, Marks] = {}
        self._bright_lights = BrightLights()

    def draw(
        self,
        state: CallerState,
        casting: Casting,
        viewer: Viewer,
        settings: LightSettings,
        receiver: Receiver,
        surface: GroundSurface | None = None,
    ) -> None:
        """Darken what lies in the receiver's plane in the caller's framebuffer.

        Depth is tested against what is drawn and not written. A viewer who is not above the plane sees no shadow.
        Shadows on the ground fade with its surface, where there is one.
        """
        if not casting or not receiver.seen_by(viewer):
            return
        sources = self._sources(settings, viewer, receiver)
        if not sources:
            return
        marks = self._marks.setdefault(receiver.key, Marks(self._ctx))
        pictures = self._ctx.info["GL_MAX_TEXTURE_SIZE"] // (viewer.size[1] + 1)
        at_once = min(MOST_LIGHTS, CHANNELS * max(pictures, 1))
        batches = [sources[start : start + at_once] for start in range(0, len(sources), at_once)]
        frame = (viewer.key, tuple(mark.key for mark in sources), receiver.ground.plane.tobytes(), *casting.key)
        if frame == marks.frame:
            self._darkening.draw(state, marks, sources, receiver, viewer, surface)
            return
        marks.frame = None
        casters = casters_for(receiver, viewer, casting)
        for batch in batches:
            self._mark_pass.draw(marks, batch, casters, viewer, receiver.ground)
            self._darkening.draw(state, marks, batch, receiver, viewer, surface)
        # Where nothing has moved, the last frame's marks are this one's.
        marks.frame = frame if len(batches) == 1 else None

    def _sources(self, settings: LightSettings, viewer: Viewer, receiver: Receiver) -> list[Mark]:
        bright = self._bright_lights.of(settings.rooms, settings.shadow_lights)
        lamps = () if receiver.mesh is None else settings.local_lights
        lights, at = (settings.lights, settings.ambient, settings.rooms, bright), receiver.middle(viewer)
        light = ground_light(*lights, at, receiver.ground, lamps)
        sources, contact = [Mark(*caster) for caster in light.casters], settings.contact_shadows
        if contact is not None and light.even.any() and receiver.stood_on:
            sources.append(Mark(contact, contact.strength * light.even))
        return sources

    def forget(self, fan: Fan) -> None:
        """Free what was made for a fan."""
        self.mark_anew()
        self._mark_pass.forget(fan)

    def mark_anew(self) -> None:
        """Draw the next frame as if the last had not been."""
        for marks in self._marks.values():
            marks.frame = None

    def keep(self, surfaces: Iterable[int]) -> None:
        """Free the marks on surfaces that are gone; `surfaces` are the keys of those that are there."""
        for key in self._marks.keys() - {None, *surfaces}:
            self._marks.pop(key).release()

    def release(self) -> None:
        """Free everything this pass made."""
        for part in (*self._marks.values(), self._mark_pass, self._darkening):
            part.release()
        self._marks.clear()
