"""A batch: copies of one fan in one renderer, and which of its pictures each shows in a frame."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from runtime.fans.lod import Levels
from runtime.fans.quad_records import QuadRecords
from runtime.fans.textures import FanTextures
from runtime.fans.tiles import TileIndex
from runtime.instances.dither import divided, part_of
from runtime.instances.instances import Instances
from runtime.instances.quads import Quads, quads_toward
from runtime.instances.view_fades import ViewFades
from runtime.viewing.viewer import Viewer


@dataclass(frozen=True, eq=False)
class Shown:
    """The quads of a batch in a frame.

    Parameters
    ----------
    quads : Quads
        Copies that fade from one view to the next are there twice.
    slots : ndarray, (N,) intp
        Of each quad in `QuadRecords`.
    parts : ndarray, (N, 2) float32
        Of the dither, from and to: which pixels each quad keeps. (0, 1) is a whole one.
    """

    quads: Quads
    slots: NDArray[np.intp]
    parts: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.quads)


@dataclass
class Batch:
    """Instances that share a fan, the fan's textures, and the instances' levels where they have a mesh, too."""

    instances: Instances
    textures: FanTextures
    levels: Levels | None = None
    fades: ViewFades = field(init=False)
    _records: QuadRecords | None = field(default=None, init=False)

    def __post_init__(self):
        self.fades = ViewFades(len(self.instances))

    @property
    def key(self) -> tuple[object, ...]:
        """Equal while the instances look the same to the same viewer."""
        # What fades is another picture in every frame.
        fade = object() if self.fades.fading else None
        return id(self.textures), *self.instances.key, self.levels and self.levels.key, fade

    def seen_by(self, viewer: Viewer) -> Quads:
        """The nearest view of each instance that shows some of its fan in the picture."""
        quads = quads_toward(self.instances, viewer.eye, viewer)
        shares = self._shares_of(quads)
        return quads if shares.all() else quads.take(shares != 0)

    def shown_to(self, viewer: Viewer, seconds: float | None, fade_seconds: float) -> Shown:
        """What a viewer is shown, so many seconds after the last frame; None is one more look at the same frame."""
        quads = self.seen_by(viewer)
        slots, parts = quads.index, part_of(self._shares_of(quads))
        if seconds is not None:
            self.fades.update(slots, quads.view, seconds, fade_seconds)
        share = self.fades.shares(slots, quads.view)
        fading = np.flatnonzero(share < 1)
        if not len(fading):
            return Shown(quads, slots, parts)
        copies = slots[fading]
        parts[fading], leaving = divided(parts[fading], share[fading])
        view = np.concatenate([quads.view, self.fades.leaving.take(copies)])
        quads = Quads(quads.placement, np.concatenate([slots, copies]), view)
        return Shown(quads, np.concatenate([slots, copies + len(self.instances)]), np.concatenate([parts, leaving]))

    def _shares_of(self, quads: Quads) -> NDArray[np.float32]:
        """The part (N,) of each one's pixels that shows the fan; below 0, from the other end of the dither."""
        shares = self.instances.shares.take(quads.index)
        return shares if self.levels is None else shares * self.levels.fan_share.take(quads.index)

    def records_with(self, index: TileIndex) -> QuadRecords:
        """The quads that the copies showed last, with tiles of an index."""
        if self._records is None or self._records.index is not index:
            self._records = QuadRecords(index, self.textures, len(self.instances))
        return self._records

    def rows(self, shown: Shown) -> NDArray[np.float32]:
        """QUAD_DTYPE records of what is shown, as plain numbers: NumPy moves records field by field."""
        assert self._records is not None, "the tiles come first"
        return self._records.rows(shown.slots)
