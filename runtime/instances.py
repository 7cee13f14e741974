"""Instances: where the copies of one fan stand, and which picture of it each shows to a viewer."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.environment.reflection import Reflection
from impostor.errors import SettingsError
from impostor.fan import Fan
from impostor.lighting import Gloss
from runtime.checks import bounded, check_type, numbers
from runtime.placement import Placement, ViewVectors


class Instances:
    """N copies of one fan. The arrays may be written in place at any time; the next draw shows it.

    An array that is replaced as a whole keeps its identity: the new values are checked and written into it.

    Parameters
    ----------
    fan : Fan
    positions : array_like, (N, 3) or (3,) float
        Where the model's origin stands, world space.
    yaws : array_like, (N,) or () float
        Turn about +Y in radians.
    scales : array_like, (N,) or () float
        Uniform, greater than 0.
    gloss : Gloss, optional
    reflection : Reflection, optional
        What the copies mirror of the rooms.

    Attributes
    ----------
    positions : ndarray, (N, 3) float64
    yaws, scales : ndarray, (N,) float64
    visible : ndarray, (N,) bool
    shares : ndarray, (N,) float32
        The part of each copy's pixels that is drawn, in a dither that stands still on screen; 1 at first. A share below
        0 takes the pixels from the other end: -0.3 is just what 0.7 leaves out, for crossfades between two copies.
    view_vectors : ViewVectors

    Raises
    ------
    SettingsError
        No fan, arrays whose lengths differ, a number that is not finite or beyond 1e15, a scale that is not positive.
        Also where an array or the reflection is replaced; of what is written into one, copies that cannot be drawn are
        left out.
    """

    def __init__(
        self,
        fan: Fan,
        positions: ArrayLike = (0.0, 0.0, 0.0),
        yaws: ArrayLike = 0.0,
        scales: ArrayLike = 1.0,
        gloss: Gloss | None = None,
        reflection: Reflection | None = None,
    ):
        check_type("fan", fan, Fan, ", as impostor.load gives")
        self.fan, self.gloss, self.reflection = fan, gloss or Gloss(), reflection
        check_type("gloss", self.gloss, Gloss)
        self._positions = np.array(bounded(fan.name, "positions", positions, (-1, 3), (3,), (0,)).reshape(-1, 3))
        count = len(self._positions)
        self._yaws, self._scales, self._visible = np.zeros(count), np.ones(count), np.ones(count, bool)
        self._shares = np.ones(count, np.float32)
        self.yaws, self.scales = yaws, scales
        self.view_vectors = ViewVectors(fan.views)
        self._placed: tuple[tuple[bytes, ...], Placement] | None = None

    @property
    def reflection(self) -> Reflection | None:
        return self._reflection

    @reflection.setter
    def reflection(self, reflection: Reflection | None) -> None:
        if reflection is not None:
            check_type("reflection", reflection, Reflection)
        self._reflection = reflection

    @property
    def positions(self) -> NDArray[np.float64]:
        return self._positions

    @positions.setter
    def positions(self, values: ArrayLike) -> None:
        self._positions[:] = bounded(self.fan.name, "positions", values, self._positions.shape)

    @property
    def yaws(self) -> NDArray[np.float64]:
        return self._yaws

    @yaws.setter
    def yaws(self, values: ArrayLike) -> None:
        self._yaws[:] = bounded(self.fan.name, "yaws", values, self._yaws.shape, ())

    @property
    def scales(self) -> NDArray[np.float64]:
        return self._scales

    @scales.setter
    def scales(self, values: ArrayLike) -> None:
        scales = bounded(self.fan.name, "scales", values, self._scales.shape, ())
        if np.any(scales <= 0):
            raise SettingsError(self.fan.name, f"scales go down to {scales.min():g}; expected more than 0")
        self._scales[:] = scales

    @property
    def visible(self) -> NDArray[np.bool_]:
        return self._visible

    @visible.setter
    def visible(self, values: ArrayLike) -> None:
        self._visible[:] = numbers(self.fan.name, "visible", values, self._visible.shape, ()) != 0

    @property
    def shares(self) -> NDArray[np.float32]:
        return self._shares

    @shares.setter
    def shares(self, values: ArrayLike) -> None:
        shares = numbers(self.fan.name, "shares", values, self._shares.shape, ())
        if np.any(np.abs(shares) > 1):
            raise SettingsError(self.fan.name, f"shares reach {np.abs(shares).max():g}; expected -1 to 1")
        self._shares[:] = shares

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def key(self) -> tuple[object, ...]:
        """Equal while the copies stand as they stood."""
        shown = self._visible.tobytes(), self._shares.tobytes()
        return id(self.fan), self.gloss, self.reflection, self.placement, *shown

    @property
    def placement(self) -> Placement:
        """Where the copies stand: the same object until a position, yaw or scale is another."""
        arrays = self._positions, self._yaws, self._scales
        written = tuple(array.tobytes() for array in arrays)
        if self._placed is None or self._placed[0] != written:
            self._placed = written, Placement.of(self.view_vectors, *arrays)
        return self._placed[1]


@dataclass(frozen=True)
class Viewer:
    """A camera as the passes need it, from the caller's two matrices.

    Parameters
    ----------
    clip_from_view, view_from_world : ndarray, (4, 4) float64
        Column-vector matrices in reading order; OpenGL clip space.
    viewport : tuple of int
        x, y, width, height in pixels.
    """

    clip_from_view: NDArray[np.float64]
    view_from_world: NDArray[np.float64]
    viewport: tuple[int, ...]

    @classmethod
    def from_matrices(cls, clip_from_view: ArrayLike, view_from_world: ArrayLike, viewport: tuple[int, ...]) -> Viewer:
        """Check the caller's matrices.

        Raises
        ------
        SettingsError
            Not 4x4, not finite, without an inverse, or a view for row vectors.
        """
        clip = numbers("camera", "clip_from_view", clip_from_view, (4, 4))
        view = numbers("camera", "view_from_world", view_from_world, (4, 4))
        *turned, one = view[3].tolist()
        if max(map(abs, turned)) > 1e-6 or abs(one - 1) > 1e-6:
            row = ", ".join(f"{value:g}" for value in view[3])
            expected = "(0, 0, 0, 1): column vectors, not rows"
            raise SettingsError("camera", f"view_from_world has the last row ({row}); expected {expected}")
        viewer = cls(clip, view, tuple(viewport))
        scaled = viewer.clip_from_world / np.maximum(np.maximum.reduce(np.abs(viewer.clip_from_world)), 1e-300)
        # Whatever its units, rounding leaves a singular matrix about 1e-16 of the volume that its rows could span.
        if not abs(np.linalg.det(scaled)) > 1e-13 * np.maximum.reduce(np.abs(scaled), axis=1).prod():
            raise SettingsError("camera", "clip_from_view @ view_from_world has no inverse; expected one that has")
        return viewer

    @property
    def key(self) -> tuple[object, ...]:
        """Equal for two viewers that see the same."""
        return self.clip_from_view.tobytes(), self.view_from_world.tobytes(), self.viewport

    @cached_property
    def clip_from_world(self) -> NDArray[np.float64]:
        """(4, 4) float64."""
        return self.clip_from_view @ self.view_from_world

    @cached_property
    def eye(self) -> NDArray[np.float64]:
        """The point where all lines of sight meet, homogeneous (4,) in world space.

        (x, y, z, 1) of a perspective camera; (dx, dy, dz, 0), the unit direction toward it, of an orthographic one.
        """
        # In clip space every line of sight runs along z, so they meet at its point at infinity.
        x, y, z, w = np.linalg.solve(self.clip_from_world, [0.0, 0.0, 1.0, 0.0])
        if abs(w) > 1e-9 * max(abs(x), abs(y), abs(z)):
            return np.array([x / w, y / w, z / w, 1.0])
        direction = np.array([x, y, z])
        direction *= np.sign(direction @ self.view_from_world[2, :3]) / np.linalg.norm(direction)
        return np.append(direction, 0.0)

    @cached_property
    def planes(self) -> NDArray[np.float64]:
        """(5, 4) float64: the frustum's sides and near end; with homogeneous points, metres on their inner side."""
        x, y, z, w = self.clip_from_world
        planes = np.stack([w + x, w - x, w + y, w - y, w + z])
        reach = np.sqrt((planes[:, :3] ** 2).sum(axis=1))
        # A plane at infinity has no direction, and everything on its inner side.
        reach[reach == 0] = np.inf
        return planes / reach[:, None]

    def pixels_per_metre(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Size on screen (N,) of one metre across the line of sight at points (N, 3); 0 behind the camera."""
        height = self.viewport[3] / 2 * abs(self.clip_from_view[1, 1])
        w = np.einsum("i,ni->n", self.clip_from_world[3, :3], points) + self.clip_from_world[3, 3]
        return np.where(w > 1e-9, height / np.maximum(w, 1e-9), 0.0)

    def nearness(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """How much nearer (N,) points (N, 3) are than the camera's plane, in metres; negative for what it sees."""
        back, offset = self.view_from_world[2, :3], self.view_from_world[2, 3]
        return (np.einsum("i,ni->n", back, points) + offset).astype(np.float32)

    def sees(self, points: NDArray[np.float64], radii: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether spheres around points (N, 3) with radii (N,) touch the view frustum."""
        # Not a matrix product: with many points that starts threads, which takes longer than the work itself.
        distances = np.einsum("pi,ni->pn", self.planes[:, :3], points)
        distances += radii
        return (distances > -self.planes[:, 3:]).all(axis=0)


@dataclass(frozen=True, eq=False)
class Quads:
    """What one viewer is shown of some instances: one fan view each, as a quad in the world.

    Parameters
    ----------
    placement : Placement
        Of all the instances.
    index : ndarray, (N,) intp
        Which of them.
    view : ndarray, (N,) intp
        Of the fan; mostly the nearest.

    Attributes
    ----------
    scale : ndarray, (N,) float64
    basis : ndarray, (N, 3, 3) float64
        The view's right, up and back as turned in the world; orthonormal.
    origin : ndarray, (N, 3) float64
        World position of the view's centre.
    center, right, up : ndarray, (N, 3) float64
        The quad: tile coordinates (x, y), in the view's metres, are drawn at `center + x right + y up`.
    """

    placement: Placement
    index: NDArray[np.intp]
    view: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.index)

    @cached_property
    def scale(self) -> NDArray[np.float64]:
        return self.placement.scales.take(self.index)

    @cached_property
    def basis(self) -> NDArray[np.float64]:
        return np.stack([self._turned(name).T for name in ("axis_right", "axis_up", "axis_back")], axis=1)

    @cached_property
    def back(self) -> NDArray[np.float64]:
        """The last of the basis (N, 3)."""
        return self._turned("axis_back").T

    @property
    def middle(self) -> NDArray[np.float64]:
        """World position (N, 3) of the middle of all the views' centres."""
        return self.placement.middles.take(self.index, axis=1).T

    @cached_property
    def origin(self) -> NDArray[np.float64]:
        return self._placed("origin").T

    @cached_property
    def center(self) -> NDArray[np.float64]:
        return self._placed("center").T

    @cached_property
    def right(self) -> NDArray[np.float64]:
        return (self.scale * self._turned("right")).T

    @cached_property
    def up(self) -> NDArray[np.float64]:
        return (self.scale * self._turned("up")).T

    @cached_property
    def _turns(self) -> NDArray[np.complex128]:
        return self.placement.turns.take(self.index)

    def _turned(self, name: str) -> NDArray[np.float64]:
        return self.placement.view_vectors.turned(name, self.view, self._turns)

    def _placed(self, name: str) -> NDArray[np.float64]:
        vectors = self._turned(name)
        vectors *= self.scale
        vectors += self.placement.positions.take(self.index, axis=1)
        return vectors

    def take(self, which: NDArray[Any]) -> Quads:
        """Some of them, by index or mask."""
        return type(self)(self.placement, self.index[which], self.view[which])


class UnturnedQuads(Quads):
    """Quads whose normals stay as the fan stores them, each in its own view."""

    @cached_property
    def basis(self) -> NDArray[np.float64]:
        return np.broadcast_to(np.eye(3), (len(self), 3, 3))


def nearest_views(instances: Instances, eye: NDArray[np.float64], index: NDArray[np.intp]) -> NDArray[np.intp]:
    """The fan view nearest to an eye, or to a light, of each instance.

    Parameters
    ----------
    instances : Instances
    eye : ndarray, (4,) float64
        Homogeneous, `Viewer.eye`; (x, y, z, 0) for a direction.
    index : ndarray, (N,) intp
        Which instances.

    Returns
    -------
    ndarray, (N,) intp
    """
    return _nearest(instances.placement, eye, index)


def _nearest(placement: Placement, eye: NDArray[np.float64], index: NDArray[np.intp]) -> NDArray[np.intp]:
    # Not of unit length: no layout asks for that.
    toward = eye[:3, None] - eye[3] * placement.middles.take(index, axis=1)
    level = toward[2] + 1j * toward[0]
    level *= placement.turns.take(index).conj()
    return placement.view_vectors.nearest(level.imag, toward[1], level.real)


def quads_toward(instances: Instances, eye: NDArray[np.float64], viewer: Viewer | None = None) -> Quads:
    """The nearest view of every visible instance, set up in the world (the paper's figure 2).

    The quad lies in the plane that follows the surface its view shows, turned with the instance: seen from the view's
    own camera that makes no difference, and from beside it what lies in the plane is drawn where the mesh would be.
    Copies with a number that is not finite, or a scale that is not positive, are left out.

    Parameters
    ----------
    instances : Instances
    eye : ndarray, (4,) float64
        Homogeneous, `Viewer.eye`.
    viewer : Viewer, optional
        Leave out what is certainly beside the picture.

    Returns
    -------
    Quads
    """
    placement = instances.placement
    shown = instances.visible & (placement.radii > 0)
    if viewer is not None:
        shown &= viewer.sees(placement.middles.T, placement.radii)
    index = np.flatnonzero(shown)
    return Quads(placement, index, _nearest(placement, eye, index))
