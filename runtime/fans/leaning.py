"""Copies that lean: fans seen from far above or below the views that they have."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from runtime.fans.lod import LevelOfDetail, ScreenSize
from runtime.instances.instances import Instances
from runtime.viewing.viewer import Viewer

FARTHEST_OFF_DEG = 20.0  # above or below the views: plausible so far, as the paper has it, though some 14 dB off


def leaning(copies: Iterable[Instances], viewer: Viewer) -> dict[str, float]:
    """The names of fans that a viewer sees leaning, and by how many degrees half of their copies are off, or more.

    A wood always has a tree that one looks up at. Copies that are too small on screen to be preferred as meshes, would
    there be one, are not counted.
    """
    seen: dict[str, list[NDArray[np.float64]]] = {}
    for instances in copies:
        fan, placement = instances.fan, instances.placement
        size, off = ScreenSize(fan).seen(viewer, placement)
        shown = viewer.sees(placement.middles.T, placement.radii) & (placement.radii > 0)
        seen.setdefault(fan.name, []).append(off[shown & (size >= LevelOfDetail.elevation_above_px)])
    off_deg = {name: np.degrees(np.concatenate(off)) for name, off in seen.items()}
    middle = {name: float(np.median(off)) for name, off in off_deg.items() if len(off)}
    return {name: off for name, off in middle.items() if off > FARTHEST_OFF_DEG}
