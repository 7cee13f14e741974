"""The fan: a few dozen small images of one object, and what always holds between them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impostor.errors import SettingsError
from impostor.views import Views

DEPTH_CODES = 65535
MIN_SIZE, MAX_SIZE = 8, 4096


@dataclass(frozen=True, eq=False)
class Fan:
    """One object seen from V cameras, in tiles of S x S texels; row 0 is the top of a tile.

    Parameters
    ----------
    name : str
    layout : {"ring", "hemisphere", "sphere"}
    views : Views
    color : ndarray, (V, S, S, 4) uint8
        Unlit albedo, sRGB, dilated past the silhouette; alpha is coverage, 0 outside the object.
    normal : tuple of ndarray, (V, S >> k, S >> k) uint8
        Normal codes of mip level k: 0 to 224, or 255 where there is no normal. View space.
    depth : ndarray, (V, S, S) uint16
        0 to 65535 across the view's depth range, larger is nearer to the camera; dilated like the colour.
    silhouette : ndarray, (V, S, S) bool
        True where at least half of the texel is covered.
    source : dict
        `name` and `sha256` of what was baked.
    settings : dict
        What it was baked with, as the command line spells it.
    bounds : ndarray, (2, 3) float64
        Lowest and highest coordinates of the object, in metres; what the views frame if not given.
    radius : float
        From the middle of the bounds to the farthest point of the object: its bounding sphere.
    """

    name: str
    layout: str
    views: Views
    color: NDArray[np.uint8]
    normal: tuple[NDArray[np.uint8], ...]
    depth: NDArray[np.uint16]
    silhouette: NDArray[np.bool_]
    source: dict[str, str] = field(default_factory=dict)
    settings: dict[str, Any] = field(default_factory=dict)
    bounds: NDArray[np.float64] = None  # type: ignore[assignment]
    radius: float = 0.0

    def __post_init__(self):
        count, size = len(self.views), self.color.shape[1]
        expected = {
            "color": (self.color, (count, size, size, 4), np.uint8),
            "depth": (self.depth, (count, size, size), np.uint16),
            "silhouette": (self.silhouette, (count, size, size), np.bool_),
        }
        for level, codes in enumerate(self.normal):
            side = max(size >> level, 1)
            expected[f"normal level {level}"] = (codes, (count, side, side), np.uint8)
        for layer, (array, shape, dtype) in expected.items():
            if array.shape != shape or array.dtype != dtype:
                found, wanted = f"{array.shape} {array.dtype}", f"{shape} {np.dtype(dtype)}"
                raise SettingsError(self.name, f"layer {layer!r} is {found}; expected {wanted}")
        if self.bounds is None:
            reach = self.views.radius[:, None]
            bounds = (self.views.center - reach).min(axis=0), (self.views.center + reach).max(axis=0)
            object.__setattr__(self, "bounds", np.stack(bounds))
        if self.radius == 0:
            object.__setattr__(self, "radius", float(self.views.radius.max()))
        if np.shape(self.bounds) != (2, 3):
            raise SettingsError(self.name, f"bounds of shape {np.shape(self.bounds)}; expected (2, 3)")
        if not self.normal:
            raise SettingsError(self.name, "no normal layer; expected at least level 0")

    @property
    def size(self) -> int:
        """Side of a tile in texels."""
        return self.color.shape[1]

    @cached_property
    def uniform_albedo(self) -> NDArray[np.uint8] | None:
        """The one sRGB colour (3,) uint8 of every covered texel, or None where the object is textured."""
        covered = self.color[self.color[..., 3] > 0]
        if not len(covered):
            return None
        low, high = covered[:, :3].min(axis=0), covered[:, :3].max(axis=0)
        return None if np.any(high - low > 1) else high

    @cached_property
    def covered_texels(self) -> int:
        """Texels of all views that the object touches."""
        return int(np.count_nonzero(self.color[..., 3]))

    @cached_property
    def covered_rectangles(self) -> NDArray[np.int32]:
        """(V, 4) int32: left, top, right, bottom of what each tile covers; right and bottom exclusive."""
        covered: NDArray[np.bool_] = self.color[..., 3] > 0
        rectangles = np.zeros((len(self.views), 4), np.int32)
        for axis, (low, high) in ((1, (0, 2)), (2, (1, 3))):
            line = np.logical_or.reduce(covered, axis=axis)
            rectangles[:, low] = line.argmax(axis=1)
            rectangles[:, high] = np.where(line.any(axis=1), line.shape[1] - line[:, ::-1].argmax(axis=1), 0)
        return rectangles
