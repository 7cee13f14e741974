"""Instances: where the copies of one fan stand, and which picture of it each shows to a viewer."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.environment.reflection import Reflection
from impostor.errors import SettingsError
from impostor.fan import Fan
from impostor.lighting import Gloss
from runtime.checks import bounded, check_type, numbers
from runtime.instances.placement import Placement, ViewVectors


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
