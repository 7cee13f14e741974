"""Animated fans: a fan for each key pose of a movement, cross-faded, for copies that each keep their own time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.errors import SettingsError
from impostor.fan import Fan
from impostor.lighting import Gloss
from runtime.checks import check_type, numbers
from runtime.instances.instances import Instances

SMALLEST_SHARE = 1 / 256  # what the dither of a crossfade can still show


class Poses(NamedTuple):
    """Which key poses show copies at some phases.

    Attributes
    ----------
    last, following : ndarray, (N,) intp
        The key poses just before and after each phase.
    share : ndarray, (N,) float32
        The part of its pixels that shows the following one, 0 to 1.
    """

    last: NDArray[np.intp]
    following: NDArray[np.intp]
    share: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class AnimatedFan:
    """One cycle of a movement: key poses evenly spaced in time, the first again after the last.

    Parameters
    ----------
    fans : sequence of Fan
        One for each key pose; all of one model, so that it stands in the same place.
    seconds : float
        Of the cycle.
    fade : float
        Part of the time between two key poses that their crossfade takes, in its middle; 1 fades all the time, and at
        0 the nearest pose stands until the next is nearer. A copy costs two quads while it fades, and one otherwise.

    Raises
    ------
    SettingsError
        No fans, a cycle that takes no time, a fade that is not 0 to 1.
    """

    fans: Sequence[Fan]
    seconds: float
    fade: float = 1.0

    def __post_init__(self):
        if not len(self.fans):
            raise SettingsError("animation", "no fans; expected one for each key pose")
        for fan in self.fans:
            check_type("animation", fan, Fan, ", as impostor.load gives")
        object.__setattr__(self, "fans", tuple(self.fans))
        if not 0 < self.seconds < np.inf:
            raise SettingsError("animation", f"a cycle of {self.seconds!r} seconds; expected a time above 0")
        if not 0 <= self.fade <= 1:
            raise SettingsError("animation", f"fade is {self.fade!r}; expected 0 to 1")

    def poses(self, phases: ArrayLike) -> Poses:
        """The key poses at phases (N,), of which 0 to 1 is one cycle."""
        count = len(self.fans)
        at = np.mod(np.asarray(phases, float), 1.0) * count
        last = np.minimum(at.astype(np.intp), count - 1)
        part = at - last
        past = part - 0.5
        # One pose has nothing to fade to; without a fade, the nearer one is shown whole.
        share = (np.clip(past / self.fade + 0.5, 0, 1) if self.fade > 0 else past >= 0) * (count > 1)
        # What the dither cannot show is not worth a quad.
        share = np.where(share < SMALLEST_SHARE, 0, np.where(share > 1 - SMALLEST_SHARE, 1, share))
        return Poses(last, (last + 1) % count, share.astype(np.float32))


class Renderer(Protocol):
    """What copies are placed in: an `ImpostorRenderer`."""

    def add(
        self, fan: Fan, positions: ArrayLike, yaws: ArrayLike, scales: ArrayLike, gloss: Gloss | None
    ) -> Instances: ...

    def remove(self, placed: AnimatedInstances) -> None: ...


class AnimatedInstances:
    """N moving copies, each at its own phase of one animation. Arrays may be written in place at any time.

    `advance` shows what was written: call it once a frame, before drawing.

    Parameters
    ----------
    renderer : ImpostorRenderer
        Where the copies are placed; each key pose becomes `Instances` there, with the copies that show it visible.
    animation : AnimatedFan
    positions, yaws, scales, gloss
        As `Instances`.
    phases : array_like, (N,) or () float
        Where in the cycle each copy begins, 0 to 1.
    speeds : array_like, (N,) or () float
        Cycles that each copy makes in the time of one; 0 stands still, below 0 goes backward.

    Attributes
    ----------
    positions : ndarray, (N, 3) float64
    yaws, scales, phases, speeds : ndarray, (N,) float64
    visible : ndarray, (N,) bool
    poses : tuple of Instances
        What the renderer has, one for each key pose.

    Raises
    ------
    SettingsError
        As `Instances`; phases or speeds of another number, or not finite.

    Examples
    --------
    >>> sway = AnimatedFan([impostor.load(f"tree_{pose}.fan") for pose in range(6)], seconds=4)  # doctest: +SKIP
    >>> trees = AnimatedInstances(renderer, sway, positions, phases=rng.random(1000))            # doctest: +SKIP
    >>> trees.advance(1 / 60)                                                                    # doctest: +SKIP
    """

    def __init__(
        self,
        renderer: Renderer,
        animation: AnimatedFan,
        positions: ArrayLike = (0.0, 0.0, 0.0),
        yaws: ArrayLike = 0.0,
        scales: ArrayLike = 1.0,
        phases: ArrayLike = 0.0,
        speeds: ArrayLike = 1.0,
        gloss: Gloss | None = None,
    ):
        check_type("animation", animation, AnimatedFan)
        copies = Instances(animation.fans[0], positions, yaws, scales, gloss)
        name, count = animation.fans[0].name, len(copies)
        self.phases, self.speeds = (
            np.array(np.broadcast_to(numbers(name, what, values, (count,), ()), count))
            for what, values in (("phases", phases), ("speeds", speeds))
        )
        self.animation, self._renderer, self._copies = animation, renderer, copies
        self.poses = tuple(
            renderer.add(fan, copies.positions, copies.yaws, copies.scales, gloss) for fan in animation.fans
        )
        self.advance(0.0)

    @property
    def positions(self) -> NDArray[np.float64]:
        return self._copies.positions

    @positions.setter
    def positions(self, values: ArrayLike) -> None:
        self._copies.positions = values

    @property
    def yaws(self) -> NDArray[np.float64]:
        return self._copies.yaws

    @yaws.setter
    def yaws(self, values: ArrayLike) -> None:
        self._copies.yaws = values

    @property
    def scales(self) -> NDArray[np.float64]:
        return self._copies.scales

    @scales.setter
    def scales(self, values: ArrayLike) -> None:
        self._copies.scales = values

    @property
    def visible(self) -> NDArray[np.bool_]:
        return self._copies.visible

    @visible.setter
    def visible(self, values: ArrayLike) -> None:
        self._copies.visible = values

    def __len__(self) -> int:
        return len(self._copies)

    def advance(self, seconds: float) -> None:
        """Let time pass, and show every copy where its arrays say, in the two key poses nearest to its phase.

        Parameters
        ----------
        seconds : float
            Since the last call; below 0 goes back.

        Raises
        ------
        SettingsError
            A number that is not finite.
        """
        if not np.isfinite(seconds):
            raise SettingsError("advance", f"{seconds!r} seconds; expected a finite number")
        self.phases += seconds / self.animation.seconds * self.speeds
        self.phases %= 1.0
        with np.errstate(invalid="ignore"):
            # Of a phase that is not a number, the copy shows nothing.
            shown = self.visible & np.isfinite(self.phases)
            last, following, share = self.animation.poses(np.where(shown, self.phases, 0))
        leaving, coming = shown & (share < 1), shown & (share > 0)
        for number, pose in enumerate(self.poses):
            before, after = leaving & (last == number), coming & (following == number)
            pose.visible[:] = before | after
            # A pose that comes takes the pixels from the other end of the dither: those that the one before leaves.
            pose.shares[:] = np.where(before, 1 - share, np.where(share < 1, -share, 1))
            chosen = np.flatnonzero(pose.visible)
            pose.positions[chosen] = self.positions[chosen]
            pose.yaws[chosen], pose.scales[chosen] = self.yaws[chosen], self.scales[chosen]

    def remove(self) -> None:
        """Take the copies out of the renderer again."""
        self._renderer.remove(self)
