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
from impostor.shadow_projection import LEVEL_CAMERA, Ground, casts_shadow, ground_from_sight, strip_points
from impostor.strips import silhouette_strips
from impostor.views import rotation_about_y
from runtime.gl_state import CallerState, clear_color, set_state
from runtime.gpu import check_texture_size, load_program, set_uniforms
from runtime.instances import Instances, Quads, Viewer, nearest_views, quads_toward
from runtime.meshes import MeshInstance, draw_parts
from runtime.relight import InstanceBuffer

CHANNELS = 4
MOST_LIGHTS = 32  # that are marked together, as the shader's array has it
SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]])  # as a triangle strip
FARTHEST = 1 - 1e-6  # in clip space: short of a far plane at infinity
ZERO, SOURCE_COLOR = 0x0000, 0x0300
CASTER_DTYPE = np.dtype([("position_scale", "f4", (4,)), ("turn", "f4", (2,)), ("rows", "f4", (4, 4))])


CastingFan = tuple[Instances, Quads, NDArray[np.void]]


class StripBuffers:
    """The strips of a fan's silhouettes on the GPU, cut view by view as lights ask for them."""

    def __init__(self, ctx: moderngl.Context, program: moderngl.Program, casters: InstanceBuffer):
        self._ctx, self._program, self._casters = ctx, program, casters
        self._held: dict[tuple[int, int], tuple[Fan, moderngl.VertexArray | None, list[moderngl.Buffer]]] = {}

    def vertex_array(self, fan: Fan, view: int) -> moderngl.VertexArray | None:
        """The strips of one view, or None where its silhouette is empty."""
        key = (id(fan), view)
        if key not in self._held:
            strips = silhouette_strips(fan.silhouette[view])
            triangles = strips.triangles()
            array, buffers = None, []
            if len(triangles):
                points = strip_points(strips, fan.views[view], fan.depth[view])
                buffers = [self._ctx.buffer(points.astype("f4").tobytes()), self._ctx.buffer(triangles.tobytes())]
                names = ("position_scale", "turn", "row0", "row1", "row2", "row3")
                layout = [
                    (buffers[0], "3f", "point"),
                    (self._casters.buffer, "4f 2f 4f 4f 4f 4f/i", *names),
                ]
                array = self._ctx.vertex_array(self._program, layout, buffers[1])
            self._held[key] = (fan, array, buffers)
        return self._held[key][1]

    def forget(self, fan: Fan) -> None:
        """Free the strips of a fan."""
        for key in [key for key, held in self._held.items() if held[0] is fan]:
            _, array, buffers = self._held.pop(key)
            for resource in (array, *buffers):
                if resource is not None:
                    resource.release()

    def release(self) -> None:
        """Free every strip."""
        for fan in {id(held[0]): held[0] for held in self._held.values()}.values():
            self.forget(fan)


class ShadowPass:
    """Darkens the ground where lights do not reach it.

    Parameters
    ----------
    ctx : moderngl.Context
    """

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self._strip_program = load_program(ctx, "shadow_strips.vert", "shadow_strips.frag")
        self._mesh_program = load_program(ctx, "shadow_mesh.vert", "shadow_mesh.frag")
        self._darken_program = load_program(ctx, "shadow_darken.vert", "shadow_darken.frag")
        self._casters = InstanceBuffer(ctx, CASTER_DTYPE)
        self._strips = StripBuffers(ctx, self._strip_program, self._casters)
        self._corners = ctx.buffer(reserve=4 * 12, dynamic=True)
        self._darken = ctx.vertex_array(self._darken_program, [(self._corners, "3f", "corner")])
        self._marks: moderngl.Texture | None = None
        self._target: moderngl.Framebuffer | None = None

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
        shown = [(instances, quads_toward(instances, viewer.eye)) for instances in fans]
        casting_fans = [
            (instances, seen, _casters(instances, seen, viewer, ground)) for instances, seen in shown if len(seen)
        ]
        # Marks of four lights stand in each picture, pictures on top of each other in one texture.
        pictures = self._ctx.info["GL_MAX_TEXTURE_SIZE"] // _size(viewer)[1]
        at_once = min(MOST_LIGHTS, CHANNELS * max(pictures, 1))
        for start in range(0, len(casting), at_once):
            group = [lights[index] for index in casting[start : start + at_once]]
            corners = _ground_rectangle(casting_fans, meshes, viewer, group, ground)
            if corners is None:
                continue
            self._mark(casting_fans, meshes, viewer, group, ground)
            self._darken_ground(state, viewer, corners, [shares[index] for index in casting[start:]][: len(group)])

    def _mark(
        self,
        fans: Sequence[CastingFan],
        meshes: Sequence[MeshInstance],
        viewer: Viewer,
        lights: Sequence[DirectionalLight],
        ground: Ground,
    ) -> None:
        target = self._target_for(viewer, -(-len(lights) // CHANNELS))
        target.use()
        set_state(color_mask=(True, True, True, True))
        clear_color()
        width, height = _size(viewer)
        for index, light in enumerate(lights):
            target.viewport = 0, index // CHANNELS * height, width, height
            mask = tuple(index % CHANNELS == channel for channel in range(CHANNELS))
            everywhere = {
                "clip_from_world": viewer.clip_from_world,
                "ground": tuple(ground.plane),
                "toward_light": light.toward,
            }
            if fans:
                set_uniforms(self._strip_program, **everywhere)
                set_state(color_mask=mask)  # type: ignore[arg-type]
                for fan in fans:
                    self._mark_fan(*fan, light)
            if meshes:
                set_uniforms(self._mesh_program, **everywhere)
                for mesh in meshes:
                    set_uniforms(self._mesh_program, world_from_model=np.asarray(mesh.world_from_model))
                    set_state(color_mask=mask)  # type: ignore[arg-type]
                    draw_parts(self._ctx, mesh.buffers, self._mesh_program, depth=False)

    def _mark_fan(self, instances: Instances, seen: Quads, casters: NDArray[np.void], light: DirectionalLight) -> None:
        light_views, _ = nearest_views(instances, np.append(light.toward, 0.0), seen.index)
        order = np.argsort(light_views, kind="stable")
        casters = casters[order]
        views, first, count = np.unique(light_views[order], return_index=True, return_counts=True)
        for view, start, number in zip(views, first, count, strict=True):
            array = self._strips.vertex_array(instances.fan, int(view))
            if array is not None:
                self._casters.write(casters[start : start + number])
                array.render(moderngl.TRIANGLES, instances=int(number))

    def _darken_ground(
        self, state: CallerState, viewer: Viewer, corners: NDArray[np.floating], shares: Sequence[NDArray[np.float64]]
    ) -> None:
        assert self._marks is not None
        state.bind_target()
        set_state(depth_test=True, blend=(ZERO, SOURCE_COLOR), polygon_offset=(-1.0, -4.0))
        self._marks.use(0)
        share = np.zeros((MOST_LIGHTS, 3))
        share[: len(shares)] = shares
        set_uniforms(
            self._darken_program,
            clip_from_world=viewer.clip_from_world,
            marks=0,
            pictures=self._marks.height // _size(viewer)[1],
            mark_origin=viewer.viewport[:2],
            share=[tuple(row) for row in share.tolist()],
        )
        self._corners.write(corners.astype("f4").tobytes())
        self._darken.render(moderngl.TRIANGLE_STRIP)

    def _target_for(self, viewer: Viewer, pictures: int) -> moderngl.Framebuffer:
        width, height = _size(viewer)
        size = (width, height * pictures)
        if self._marks is None or self._marks.size != size or self._target is None:
            self._release_target()
            check_texture_size(self._ctx, f"shadows of {pictures * CHANNELS} lights", *size)
            self._marks = self._ctx.texture(size, CHANNELS)
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
        self._strips.forget(fan)

    def release(self) -> None:
        """Free everything this pass made."""
        self._release_target()
        self._strips.release()
        self._casters.release()
        for resource in (self._darken, self._corners):
            resource.release()
        for program in (self._strip_program, self._mesh_program, self._darken_program):
            program.release()


def _size(viewer: Viewer) -> tuple[int, int]:
    return max(viewer.viewport[2], 1), max(viewer.viewport[3], 1)


def _shares(lights: Sequence[DirectionalLight], ambient: ArrayLike, ground: Ground) -> list[NDArray[np.float64]]:
    """Each light's part (3,) of the linear light on the ground."""
    given = [max(float(ground.normal @ light.toward), 0.0) * np.array(light.color) for light in lights]
    total = np.sum([np.broadcast_to(np.asarray(ambient, float), (3,)), *given], axis=0)
    return [part / np.maximum(total, 1e-9) for part in given]


def _casters(instances: Instances, seen: Quads, viewer: Viewer, ground: Ground) -> NDArray[np.void]:
    """Placement, and `shadow_projection.viewer_ground_from_ground`, of many instances at once."""
    views = instances.fan.views
    casters = np.zeros(len(seen), CASTER_DTYPE)
    yaws = instances.yaws[seen.index]
    casters["position_scale"][:, :3] = instances.positions[seen.index]
    casters["position_scale"][:, 3] = seen.scale
    casters["turn"] = np.stack([np.cos(yaws), np.sin(yaws)], axis=-1)
    plane_from_world = np.zeros((len(seen), 3, 4))
    plane_from_world[:, :, :3] = seen.basis
    plane_from_world[:, :, 3] = -np.einsum("nij,nj->ni", seen.basis, seen.origin)
    if np.isfinite(views.distance):
        eye_distance = views.distance * seen.scale
        plane_from_world[:, :2] *= eye_distance[:, None, None]
        plane_from_world[:, 2] *= -1
        plane_from_world[:, 2, 3] += eye_distance
    else:
        plane_from_world[:, 2] = [0, 0, 0, 1]
    world_from_plane = np.zeros((len(seen), 4, 3))
    # Plane coordinates are world metres here, the quad's axes are for metres of the view.
    right, up = seen.right / seen.scale[:, None], seen.up / seen.scale[:, None]
    world_from_plane[:, :3] = np.stack([right, up, seen.center], axis=-1)
    world_from_plane[:, 3, 2] = 1
    level = np.abs(seen.basis[:, 2] @ ground.normal) < LEVEL_CAMERA
    casters["rows"] = ground_from_sight(viewer.eye, ground) @ world_from_plane @ plane_from_world
    casters["rows"][level] = np.eye(4)
    return casters


def _ground_rectangle(
    fans: Sequence[CastingFan],
    meshes: Sequence[MeshInstance],
    viewer: Viewer,
    lights: Sequence[DirectionalLight],
    ground: Ground,
) -> NDArray[np.floating] | None:
    """Corners (4, 3), as a triangle strip, of a rectangle on the ground that holds every shadow that can be seen.

    None where there is none.
    """
    placed = [(*_fan_spheres(instances, seen), casters["rows"]) for instances, seen, casters in fans]
    placed += [(*_mesh_sphere(mesh), np.eye(4)[None]) for mesh in meshes]
    if not placed:
        return None
    centers, radii, moved = (np.concatenate(parts) for parts in zip(*placed, strict=True))
    tangent = np.cross(ground.normal, np.eye(3)[np.argmin(np.abs(ground.normal))])
    tangent /= np.linalg.norm(tangent)
    axes = np.stack([tangent, np.cross(ground.normal, tangent)])
    low, high = _seen_ground(viewer, axes)
    found = []
    for light in lights:
        slope = np.array(light.toward) / (ground.normal @ light.toward)
        height = centers @ ground.normal - ground.offset
        # A sphere's shadow is an ellipse, longer the more the light slopes along an axis.
        reach = radii[:, None] * np.sqrt(1 + (axes @ slope) ** 2)
        square = (centers - height[:, None] * slope)[:, None] + (SQUARE * reach[:, None]) @ axes
        # Where the viewer is shown it: steps 3 to 5 move what the true shadow covers.
        shown = np.einsum("nij,nkj->nki", moved[..., :3], square) + moved[:, None, :, 3]
        weight = shown[..., 3]
        flat = shown[..., :3] @ axes.T / np.where(weight > 0, weight, 1)[..., None]
        endless = (weight <= 0).any(axis=1)[:, None]
        found.append(np.where(endless, -np.inf, flat.min(axis=1)).min(axis=0))
        found.append(np.where(endless, np.inf, flat.max(axis=1)).max(axis=0))
    low, high = np.maximum(low, np.min(found, axis=0)), np.minimum(high, np.max(found, axis=0))
    if np.any(low >= high):
        return None
    return np.where(SQUARE > 0, high, low) @ axes + ground.offset * ground.normal


def _seen_ground(viewer: Viewer, axes: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least and greatest coordinates (2,) along two world axes that lie in the viewer's frustum."""
    corners = np.array([[x, y, z, 1.0] for x in (-1, 1) for y in (-1, 1) for z in (-1, FARTHEST)])
    points = corners @ np.linalg.inv(viewer.clip_from_world).T
    flat = points[:, :3] / points[:, 3:] @ axes.T
    return flat.min(axis=0), flat.max(axis=0)


def _fan_spheres(instances: Instances, seen: Quads) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    low, high = instances.fan.bounds
    turned = np.einsum("nij,j->ni", rotation_about_y(instances.yaws[seen.index]), (low + high) / 2)
    return instances.positions[seen.index] + seen.scale[:, None] * turned, seen.scale * np.linalg.norm(high - low) / 2


def _mesh_sphere(mesh: MeshInstance) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    low, high = mesh.buffers.model.bounds
    matrix = np.asarray(mesh.world_from_model, float)
    center = matrix[:3, :3] @ ((low + high) / 2) + matrix[:3, 3]
    scale = np.abs(np.linalg.det(matrix[:3, :3])) ** (1 / 3)
    return center[None], np.array([np.linalg.norm(high - low) / 2 * scale])
