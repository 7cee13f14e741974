"""What a fan may be baked with: checked once, for the library and the command, before anything is loaded."""

from __future__ import annotations

import math
from numbers import Real

import numpy as np

from impostor.checks import check_whole
from impostor.errors import SettingsError
from impostor.fan import MAX_SIZE, MIN_SIZE
from impostor.views import MAX_VIEWS, layout_bases

RING_ELEVATION_DEG = 15.0
SAMPLES = (1, 2, 4)


def camera_bases(
    views: int, elevation_deg: float | None, layout: str, size: int, distance: float, samples: int | None
) -> np.ndarray:
    """Check what `bake_fan` takes, and make the bases (views, 3, 3) of its cameras.

    Raises
    ------
    SettingsError
        A number or a choice out of range, or an elevation for something else than a ring.
    """
    check_whole("views", views, 1, MAX_VIEWS)
    check_whole("size", size, MIN_SIZE, MAX_SIZE)
    if elevation_deg is not None and not isinstance(elevation_deg, Real):
        raise SettingsError("elevation", f"a {type(elevation_deg).__name__}; expected a number of degrees")
    if not isinstance(distance, Real):
        raise SettingsError("distance", f"a {type(distance).__name__}; expected a distance above 0")
    elevation = RING_ELEVATION_DEG if elevation_deg is None else elevation_deg
    bases = layout_bases(layout, views, math.radians(elevation))
    if elevation_deg is not None and layout != "ring":
        raise SettingsError("elevation", f"{elevation_deg:g} degrees of a {layout}; expected it of a ring only")
    if not distance > 0:
        raise SettingsError("distance", f"{distance:g} m; expected a distance above 0")
    if samples is not None and samples not in SAMPLES:
        raise SettingsError("samples", f"{samples}; expected {', '.join(map(str, SAMPLES[:-1]))} or {SAMPLES[-1]}")
    return bases
