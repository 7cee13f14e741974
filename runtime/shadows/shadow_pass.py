"""The shadow pass: strips of fans and triangles of meshes, marked on the ground and taken from its light once.

The marks are a texture of the pass's own, one light a channel, and do what a stencil would: overlapping strips mark
a pixel once. moderngl makes no framebuffer with a stencil, so few callers have one; and all lights are marked before
the ground is darkened, so that each takes away just the light it gave. The channel of a light with a softness holds
how much of it is hidden. Contact shadows have a channel as if they were one light more.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.fan import Fan
from impostor.lighting import DirectionalLight
from impostor.shadow_projection import Ground
from runtime.fans.batch import Batch
from runtime.gl.programs import load_program, set_uniforms
from runtime.gl.state import CallerState, clear_color, set_state
from runtime.gl.uploads import CORNERS, InstanceBuffer, check_texture_size
from runtime.ground.ground_light import BrightLights, ground_light
from runtime.ground.ground_pass import GroundSurface, metres_from_screen
from runtime.lights.contact_settings import ContactShadows
from runtime.lights.settings import LightSettings
from runtime.meshes.mesh_pass import MeshCopies, MeshInstance
from runtime.shadows.bounds import CELL, covered_cells, in_view, shadow_hulls
from runtime.shadows.contact import ContactPass
from runtime.shadows.meshes import MeshShadowPass, mesh_corners
from runtime.shadows.soft_light import penumbra_pixels, points_affordable, points_needed, source_rim
from runtime.shadows.soft_marks import Mask, SoftMarks
from runtime.shadows.strips import CastingFan, StripPass
from runtime.viewing.viewer import Viewer

CHANNELS = 4
MOST_LIGHTS = 32  # that are marked together, as the shader's array has it
CELL_DTYPE = np.dtype([("cell", "f4", (2,))])
ZERO, SOURCE_COLOR = 0x0000, 0x0300


class _Group(NamedTuple):
    """Copies of a fan or of a mesh, what draws them, and where their bounding boxes are."""

    draws: StripPass | MeshShadowPass
    copies: Any
    corners: NDArray[np.float64]
    clip_from_shadow: tuple[NDArray[np.float64], ...]
    """From the true shadow: to where it may be seen."""
    triangles: int
    """Of one copy; 0 where they do not count."""

    def hulls(self, light: DirectionalLight, ground: Ground) -> NDArray[np.float64]:
        """`shadow_hulls` of the copies."""
        return np.concatenate([shadow_hulls(self.corners, each, light, ground) for each in self.clip_from_shadow], 1)


class _Mark(NamedTuple):
    """What is marked in one channel, and its part (3,) of the linear light on the ground."""

    source: DirectionalLight | ContactShadows
    share: NDArray[np.float64]

    @property
    def key(self) -> tuple[object, ...]:
        """Equal for two whose marks are the same."""
        if isinstance(self.source, ContactShadows):
            return ("contact", self.source.reach)
        soft = self.source.softness
        return (self.source.toward, soft, float(self.share.max()) if soft else 0.0)


class ShadowPass:
    """Darkens the ground where lights do not reach it.

    Parameters
    ----------
    ctx : moderngl.Context
    """

    memory_kind = "shadow marks"

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self._strips, self._meshes, self._contacts = StripPass(ctx), MeshShadowPass(ctx), ContactPass(ctx)
        self._corners, self._cells = ctx.buffer(CORNERS), InstanceBuffer(ctx, CELL_DTYPE)
        self._soft_marks = SoftMarks(ctx, self._corners, self._cells.buffer)
        cells = [(self._corners, "2f", "corner"), (self._cells.buffer, "2f/i", "cell")]
        names = ("shadow_darken.frag", "shadow_darken_fading.frag", "shadow_darken_many.frag")
        self._darken_programs = [load_program(ctx, "shadow_darken.vert", name) for name in names]
        arrays = (ctx.vertex_array(program, cells) for program in self._darken_programs)
        self._few_lights, self._fading, self._many_lights = arrays
        self._marks: moderngl.Texture | None = None
        self._target: moderngl.Framebuffer | None = None
        self._frame: tuple[object, ...] | None = None
        self._marked_cells, self._bright_lights = 0, BrightLights()

    def draw(
        self,
        state: CallerState,
        fans: Sequence[Batch],
        meshes: Sequence[MeshInstance],
        viewer: Viewer,
        settings: LightSettings,
        ground: Ground,
        surface: GroundSurface | None = None,
    ) -> None:
        """Darken what lies on the ground plane in the caller's framebuffer.

        Depth is tested against what is drawn and not written. A viewer who is not above the ground sees no shadow.
        Shadows fade with the surface, where there is one.
        """
        if ground.plane @ viewer.eye <= 0 or not (len(fans) or len(meshes)):
            return
        marks = self._marks_of(settings, viewer, ground)
        if not marks:
            return
        # Marks of four lights stand in each picture, pictures on top of each other in one texture.
        pictures = self._ctx.info["GL_MAX_TEXTURE_SIZE"] // (_size(viewer)[1] + 1)
        at_once = min(MOST_LIGHTS, CHANNELS * max(pictures, 1))
        batches = [marks[start : start + at_once] for start in range(0, len(marks), at_once)]
        frame = _frame_key(fans, meshes, viewer, marks, ground)
        if frame != self._frame:
            self._frame = None
            casters = [
                CastingFan.of(fan.instances, viewer, ground, fan.levels and fan.levels.fan_share) for fan in fans
            ]
            groups = self._groups(casters, MeshCopies.gathered(meshes), viewer)
            for batch in batches:
                self._mark(groups, viewer, batch, ground)
                self._darken_ground(state, viewer, ground, batch, surface)
            # Where nothing has moved, the last frame's marks are this one's.
            self._frame = frame if len(batches) == 1 else None
        else:
            self._darken_ground(state, viewer, ground, batches[0], surface)

    def _marks_of(self, settings: LightSettings, viewer: Viewer, ground: Ground) -> list[_Mark]:
        bright = self._bright_lights.of(settings.rooms, settings.shadow_lights)
        light = ground_light(settings.lights, settings.ambient, settings.rooms, bright, viewer, ground)
        marks, contact = [_Mark(*caster) for caster in light.casters], settings.contact_shadows
        if contact is not None and light.even.any():
            marks.append(_Mark(contact, contact.strength * light.even))
        return marks

    def _groups(self, fans: Sequence[CastingFan], meshes: Sequence[MeshCopies], viewer: Viewer) -> list[_Group]:
        clip = viewer.clip_from_world
        return [
            # The shadow of a fan lies between where it meets the picture's feet and where the light casts it.
            *(
                _Group(self._strips, fan, fan.corners(), (clip @ fan.records["rows"].astype(float), clip[None]), 0)
                for fan in fans
            ),
            *(
                _Group(self._meshes, mesh, mesh_corners(mesh), (clip[None],), mesh.buffers.triangle_count)
                for mesh in meshes
            ),
        ]

    def _mark(self, groups: Sequence[_Group], viewer: Viewer, marks: Sequence[_Mark], ground: Ground) -> None:
        """Mark where each light is kept from the ground, and find the cells of the picture that hold marks."""
        width, height = _size(viewer)
        target = self._target_for(viewer, len(marks))
        target.use()
        set_state(color_mask=(True, True, True, True))
        clear_color()
        # Marks lie on the corners of pixels, so that one bilinear fetch averages the four around a pixel's centre.
        on_corners = np.diag([width / (width + 1), height / (height + 1), 1.0, 1.0]) @ viewer.clip_from_world
        hulls = []
        for index, mark in enumerate(marks):
            first_row = index // CHANNELS * (height + 1)
            target.viewport = 0, first_row, width + 1, height + 1
            mask = _channel_mask(index % CHANNELS)
            set_state(color_mask=mask)
            if isinstance(mark.source, ContactShadows):
                hulls += self._contacts.draw(groups, on_corners, viewer, ground, mark.source)
                continue
            for part in (self._strips, self._meshes):
                part.begin(on_corners, mark.source, ground)
            if mark.source.softness:
                hulls += self._mark_soft(groups, viewer, mark, ground, first_row, mask)
            else:
                hulls += self._mark_hard(groups, mark.source, ground)
        self._marked_cells = self._write_cells(hulls, width, height)

    def _mark_hard(
        self, groups: Sequence[_Group], light: DirectionalLight, ground: Ground
    ) -> list[NDArray[np.float64]]:
        """Draw shadows into the bound channel; gives their hulls."""
        hulls = []
        for group in groups:
            hull = group.hulls(light, ground)
            chosen = np.flatnonzero(in_view(hull))
            if len(chosen):
                group.draws.draw(group.copies, chosen, light, ground)
                hulls.append(hull[chosen])
        return hulls

    def _mark_soft(
        self,
        groups: Sequence[_Group],
        viewer: Viewer,
        mark: _Mark,
        ground: Ground,
        first_row: int,
        channel: Mask,
    ) -> list[NDArray[np.float64]]:
        """Draw how much of a light is hidden into the bound channel; gives the hulls of the shadows."""
        light, casting = mark.source, []
        assert isinstance(light, DirectionalLight)
        for group in groups:
            hull = np.concatenate([group.hulls(edge, ground) for edge in source_rim(light, ground)], axis=1)
            chosen = np.flatnonzero(in_view(hull))
            if len(chosen):
                penumbra = penumbra_pixels(group.corners[chosen], light, ground, viewer)
                most = points_affordable(group.triangles * len(chosen))
                points = points_needed(penumbra, float(mark.share.max()), most)
                casting.append((group, chosen, points, hull[chosen]))
        soft = [
            (group, chosen[points > 1], points[points > 1], hull[points > 1]) for group, chosen, points, hull in casting
        ]
        soft = [each for each in soft if len(each[1])]
        if soft:
            self._resolve_soft(soft, viewer, light, ground, first_row, channel)
        for group, chosen, points, _ in casting:
            if (points == 1).any():
                group.draws.draw(group.copies, chosen[points == 1], light, ground)
        return [hull for *_, hull in casting]

    def _resolve_soft(
        self,
        casting: Sequence[tuple[_Group, NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]],
        viewer: Viewer,
        light: DirectionalLight,
        ground: Ground,
        first_row: int,
        channel: Mask,
    ) -> None:
        """Draw copies that cast from several points each: groups, which copies, from how many, and their hulls."""
        width, height = _size(viewer)
        self._soft_marks.begin(width + 1, height + 1)
        pixels = height / 2 * abs(viewer.clip_from_view[1, 1])
        for group, chosen, points, _ in casting:
            set_state(merge_bits=True)
            group.draws.draw_soft(group.copies, chosen, light, ground, points, pixels)
        assert self._target is not None
        self._target.use()
        count = self._write_cells([hull for *_, hull in casting], width, height)
        squash = abs(float(viewer.view_from_world[2, :3] @ ground.normal))
        self._soft_marks.resolve(channel, first_row, count, squash)

    def _write_cells(self, hulls: Sequence[NDArray[np.float64]], width: int, height: int) -> int:
        """Upload the cells of the picture that shadows may touch; gives their number."""
        cells = [covered_cells(hull, width, height) for hull in hulls]
        found = np.unique(np.concatenate(cells), axis=0) if cells else np.zeros((0, 2))
        records = np.zeros(len(found), CELL_DTYPE)
        records["cell"] = found
        self._cells.write(records)
        return len(found)

    def _darken_ground(
        self, state: CallerState, viewer: Viewer, ground: Ground, marks: Sequence[_Mark], surface: GroundSurface | None
    ) -> None:
        assert self._marks is not None
        plane = ground.plane @ np.linalg.inv(viewer.clip_from_world)
        if not self._marked_cells or abs(plane[2]) < 1e-12 * np.abs(plane).max():
            return
        state.bind_target()
        set_state(depth_test=True, blend=(ZERO, SOURCE_COLOR), polygon_offset=(-1.0, -4.0))
        self._marks.use(0)
        width, height = _size(viewer)
        array, room = self._few_lights if surface is None else self._fading, CHANNELS
        if len(marks) > CHANNELS:
            array, room = self._many_lights, MOST_LIGHTS
            set_uniforms(array.program, pictures=-(-len(marks) // CHANNELS), rows=height + 1)
        if array is not self._few_lights:
            set_uniforms(array.program, **_fading(viewer, ground, surface))
        shares = np.array([mark.share for mark in marks])
        set_uniforms(
            array.program,
            # Depth of the ground is linear in x and y on the screen.
            ground_depth=tuple(-plane[[0, 1, 3]] / plane[2]),
            cell_size=(2 * CELL / width, 2 * CELL / height),
            marks=0,
            mark_origin=viewer.viewport[:2],
            share=np.concatenate([shares, np.zeros((room - len(shares), 3))]),
        )
        array.render(moderngl.TRIANGLE_STRIP, instances=self._marked_cells)

    def _target_for(self, viewer: Viewer, lights: int) -> moderngl.Framebuffer:
        width, height = _size(viewer)
        pictures, channels = -(-lights // CHANNELS), 1 if lights == 1 else CHANNELS
        size = (width + 1, (height + 1) * pictures)
        if (
            self._marks is None
            or self._target is None
            or (self._marks.size, self._marks.components) != (size, channels)
        ):
            self._release_target()
            check_texture_size(self._ctx, f"shadows of {lights} lights", *size)
            self._marks = self._ctx.texture(size, channels)
            self._marks.filter = (moderngl.LINEAR, moderngl.LINEAR)
            self._marks.repeat_x = self._marks.repeat_y = False
            self._target = self._ctx.framebuffer([self._marks])
        return self._target

    def _release_target(self) -> None:
        for resource in (self._target, self._marks):
            if resource is not None:
                resource.release()
        self._target = self._marks = None

    def forget(self, fan: Fan) -> None:
        """Free what was made for a fan."""
        self._frame = None
        self._strips.forget(fan)
        self._contacts.forget(fan)

    def release(self) -> None:
        """Free everything this pass made."""
        self._release_target()
        parts = self._strips, self._meshes, self._contacts, self._soft_marks
        arrays = self._few_lights, self._fading, self._many_lights
        for part in (*parts, *arrays, self._corners, self._cells, *self._darken_programs):
            part.release()


def _size(viewer: Viewer) -> tuple[int, int]:
    return max(viewer.viewport[2], 1), max(viewer.viewport[3], 1)


def _channel_mask(channel: int) -> Mask:
    return channel == 0, channel == 1, channel == 2, channel == 3


def _fading(viewer: Viewer, ground: Ground, surface: GroundSurface | None) -> dict[str, Any]:
    """Uniforms of `shadow_fade.glsl`; without a surface every place is its middle."""
    if surface is None:
        return {"metres_from_screen": np.diag([0.0, 0.0, 1.0]), "fade": (1.0, 2.0)}
    return {"metres_from_screen": metres_from_screen(viewer, ground, surface), "fade": surface.fade}


def _frame_key(
    fans: Sequence[Batch],
    meshes: Sequence[MeshInstance],
    viewer: Viewer,
    marks: Sequence[_Mark],
    ground: Ground,
) -> tuple[object, ...]:
    """Equal for two frames that hold the same marks."""
    return (
        viewer.key,
        tuple(mark.key for mark in marks),
        ground.plane.tobytes(),
        *((*fan.instances.key, fan.levels and fan.levels.key) for fan in fans),
        *((id(mesh.buffers), np.asarray(mesh.world_from_model, float).tobytes()) for mesh in meshes),
    )
