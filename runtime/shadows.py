"""The shadow pass: strips of fans and triangles of meshes, marked on the ground and taken from its light once.

The marks are a texture of the pass's own, one light a channel, and do what a stencil would: overlapping strips mark
a pixel once. moderngl makes no framebuffer with a stencil, so few callers have one; and all lights are marked before
the ground is darkened, so that each takes away just the light it gave.
"""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.fan import Fan
from impostor.lighting import DirectionalLight
from impostor.shadow_projection import Ground, casts_shadow
from runtime.gl_state import CallerState, clear_color, set_state
from runtime.gpu import InstanceBuffer, check_texture_size, load_program, set_uniforms
from runtime.instances import Instances, Viewer
from runtime.meshes import MeshInstance, draw_parts
from runtime.relight import CORNERS
from runtime.shadow_bounds import CELL, box_corners, covered_cells, in_view, shadow_hulls
from runtime.shadow_strips import CastingFan, StripPass

CHANNELS = 4
MOST_LIGHTS = 32  # that are marked together, as the shader's array has it
CELL_DTYPE = np.dtype([("cell", "f4", (2,))])
ZERO, SOURCE_COLOR = 0x0000, 0x0300


class ShadowPass:
    """Darkens the ground where lights do not reach it.

    Parameters
    ----------
    ctx : moderngl.Context
    """

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self._strips = StripPass(ctx)
        self._mesh_program = load_program(ctx, "shadow_mesh.vert", "shadow_mesh.frag")
        self._corners, self._cells = ctx.buffer(CORNERS), InstanceBuffer(ctx, CELL_DTYPE)
        cells = [(self._corners, "2f", "corner"), (self._cells.buffer, "2f/i", "cell")]
        names = ("shadow_darken.frag", "shadow_darken_many.frag")
        self._darken_programs = [load_program(ctx, "shadow_darken.vert", name) for name in names]
        self._few_lights, self._many_lights = (ctx.vertex_array(program, cells) for program in self._darken_programs)
        self._marks: moderngl.Texture | None = None
        self._target: moderngl.Framebuffer | None = None
        self._frame: tuple[object, ...] | None = None
        self._marked_cells = 0

    def draw(
        self,
        state: CallerState,
        fans: Sequence[Instances],
        meshes: Sequence[MeshInstance],
        viewer: Viewer,
        lights: Sequence[DirectionalLight],
        ambient: ArrayLike,
        ground: Ground,
    ) -> None:
        """Darken what lies on the ground plane in the caller's framebuffer.

        Depth is tested against what is drawn and not written. A viewer who is not above the ground sees no shadow.
        """
        if ground.plane @ viewer.eye <= 0 or not (len(fans) or len(meshes)):
            return
        shares = _shares(lights, ambient, ground)
        casting = [
            index for index, share in enumerate(shares) if casts_shadow(lights[index].toward, ground) and share.any()
        ]
        # Marks of four lights stand in each picture, pictures on top of each other in one texture.
        pictures = self._ctx.info["GL_MAX_TEXTURE_SIZE"] // (_size(viewer)[1] + 1)
        at_once = min(MOST_LIGHTS, CHANNELS * max(pictures, 1))
        groups = [casting[start : start + at_once] for start in range(0, len(casting), at_once)]
        frame = _frame_key(fans, meshes, viewer, [lights[index] for index in casting], ground)
        if frame != self._frame:
            self._frame = None
            casters = [CastingFan.of(instances, viewer, ground) for instances in fans]
            for group in groups:
                self._mark(casters, meshes, viewer, [lights[index] for index in group], ground)
                self._darken_ground(state, viewer, ground, [shares[index] for index in group])
            # Where nothing has moved, the last frame's marks are this one's.
            self._frame = frame if len(groups) == 1 else None
        else:
            self._darken_ground(state, viewer, ground, [shares[index] for index in groups[0]])

    def _mark(
        self,
        fans: Sequence[CastingFan],
        meshes: Sequence[MeshInstance],
        viewer: Viewer,
        lights: Sequence[DirectionalLight],
        ground: Ground,
    ) -> None:
        """Mark where each light is kept from the ground, and find the cells of the picture that hold marks."""
        width, height = _size(viewer)
        target = self._target_for(viewer, len(lights))
        target.use()
        set_state(color_mask=(True, True, True, True))
        clear_color()
        # Marks lie on the corners of pixels, so that one bilinear fetch averages the four around a pixel's centre.
        on_corners = np.diag([width / (width + 1), height / (height + 1), 1.0, 1.0]) @ viewer.clip_from_world
        boxes = [(fan.corners(), viewer.clip_from_world @ fan.records["rows"].astype(float)) for fan in fans]
        mesh_boxes = [(_mesh_corners(mesh), viewer.clip_from_world[None]) for mesh in meshes]
        hulls = []
        for index, light in enumerate(lights):
            target.viewport = 0, index // CHANNELS * (height + 1), width + 1, height + 1
            mask = tuple(index % CHANNELS == channel for channel in range(CHANNELS))
            set_state(color_mask=mask)  # type: ignore[arg-type]
            self._strips.begin(on_corners, light, ground)
            for fan, box in zip(fans, boxes, strict=True):
                hull = shadow_hulls(*box, light, ground)
                chosen = np.flatnonzero(in_view(hull))
                if len(chosen):
                    self._strips.draw(fan, chosen, light, ground)
                    hulls.append(hull[chosen])
            for mesh, box in zip(meshes, mesh_boxes, strict=True):
                hull = shadow_hulls(*box, light, ground)
                if in_view(hull).any():
                    self._mark_mesh(mesh, on_corners, light, ground, mask)
                    hulls.append(hull)
        cells = [covered_cells(hull, width, height) for hull in hulls]
        found = np.unique(np.concatenate(cells), axis=0) if cells else np.zeros((0, 2))
        records = np.zeros(len(found), CELL_DTYPE)
        records["cell"] = found
        self._cells.write(records)
        self._marked_cells = len(found)

    def _mark_mesh(
        self,
        mesh: MeshInstance,
        clip_from_world: NDArray[np.float64],
        light: DirectionalLight,
        ground: Ground,
        mask: tuple[bool, ...],
    ) -> None:
        set_uniforms(
            self._mesh_program,
            clip_from_world=clip_from_world,
            ground=tuple(ground.plane),
            toward_light=light.toward,
            world_from_model=np.asarray(mesh.world_from_model),
        )
        set_state(color_mask=mask)  # type: ignore[arg-type]
        draw_parts(self._ctx, mesh.buffers, self._mesh_program, depth=False)

    def _darken_ground(
        self, state: CallerState, viewer: Viewer, ground: Ground, shares: Sequence[NDArray[np.float64]]
    ) -> None:
        assert self._marks is not None
        plane = ground.plane @ np.linalg.inv(viewer.clip_from_world)
        if not self._marked_cells or abs(plane[2]) < 1e-12 * np.abs(plane).max():
            return
        state.bind_target()
        set_state(depth_test=True, blend=(ZERO, SOURCE_COLOR), polygon_offset=(-1.0, -4.0))
        self._marks.use(0)
        width, height = _size(viewer)
        array, room = (self._few_lights, CHANNELS) if len(shares) <= CHANNELS else (self._many_lights, MOST_LIGHTS)
        if array is self._many_lights:
            set_uniforms(array.program, pictures=-(-len(shares) // CHANNELS), rows=height + 1)
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

    def release(self) -> None:
        """Free everything this pass made."""
        self._release_target()
        for part in (self._strips, self._few_lights, self._many_lights, self._corners, self._cells):
            part.release()
        for program in (self._mesh_program, *self._darken_programs):
            program.release()


def _size(viewer: Viewer) -> tuple[int, int]:
    return max(viewer.viewport[2], 1), max(viewer.viewport[3], 1)


def _frame_key(
    fans: Sequence[Instances],
    meshes: Sequence[MeshInstance],
    viewer: Viewer,
    lights: Sequence[DirectionalLight],
    ground: Ground,
) -> tuple[object, ...]:
    """Equal for two frames that hold the same marks."""
    return (
        viewer.key,
        tuple(light.toward for light in lights),
        ground.plane.tobytes(),
        *(instances.key for instances in fans),
        *((id(mesh.buffers), np.asarray(mesh.world_from_model, float).tobytes()) for mesh in meshes),
    )


def _shares(lights: Sequence[DirectionalLight], ambient: ArrayLike, ground: Ground) -> list[NDArray[np.float64]]:
    """Each light's part (3,) of the linear light on the ground."""
    given = [max(float(ground.normal @ light.toward), 0.0) * np.array(light.color) for light in lights]
    total = np.sum([np.broadcast_to(np.asarray(ambient, float), (3,)), *given], axis=0)
    return [part / np.maximum(total, 1e-9) for part in given]


def _mesh_corners(mesh: MeshInstance) -> NDArray[np.float64]:
    matrix = np.asarray(mesh.world_from_model, float)
    return (box_corners(*mesh.buffers.model.bounds) @ matrix[:3, :3].T + matrix[:3, 3])[None]
