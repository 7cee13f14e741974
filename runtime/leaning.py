"""Copies that lean: fans seen from far above or below the views that they have."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from runtime.instances import Instances, Viewer
from runtime.lod import LevelOfDetail, ScreenSize

FARTHEST_OFF_DEG = 20.0  # above or below the views: plausible so far, as the paper has it, though some 14 dB off


def leaning(copies: Iterable[Instances], viewer: Viewer) -> dict[str, float]:
    """The names of fans that a viewer sees leaning, and by how many degrees the worst of their copies is off.

    Copies that are too small on screen to be preferred as meshes, would there be one, are not counted.
    """
    found: dict[str, float] = {}
    for instances in copies:
        fan, placement = instances.fan, instances.placement
        size, off = ScreenSize(fan).seen(viewer, placement)
        shown = viewer.sees(placement.middles.T, placement.radii) & (placement.radii > 0)
        worst = np.degrees(off[shown & (size >= LevelOfDetail.elevation_above_px)].max(initial=0.0)).item()
        if worst > FARTHEST_OFF_DEG:
            found[fan.name] = max(worst, found.get(fan.name, 0.0))
    return found
