"""What a fan would hold without its codes: the normals as captured, and pictures lit with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bake.capture import Capture
from bake.fan import DILATION
from bake.resolve import TileLayers, dilate, resolve
from impostor.fan import Fan
from impostor.lighting import DirectionalLight
from impostor.model import Model
from impostor.normal_code import encode
from impostor.srgb import linear_from_srgb, srgb_from_linear


def exact_layers(model: Model, fan: Fan) -> tuple[TileLayers, NDArray[np.bool_]]:
    """The layers of every view of a fan before they are coded, and where there is a surface or a continued one."""
    with Capture(model, fan.size, fan.settings.get("samples")) as capture:
        tiles = [dilate(resolve(capture.view(view), capture.samples), DILATION) for view in fan.views]
    names = TileLayers.__dataclass_fields__
    layers = TileLayers(*(np.stack([getattr(tile, name) for tile, _ in tiles]) for name in names))
    return layers, np.stack([filled for _, filled in tiles]) | (layers.coverage > 0)


def undithered(fan: Fan, layers: TileLayers, mask: NDArray[np.bool_]) -> Fan:
    """The fan with the nearest code everywhere, in its finest level; the others stay dithered."""
    return replace(fan, normal=(encode(layers.normal, mask), *fan.normal[1:]))


def lit_exactly(fan: Fan, layers: TileLayers, lights: Sequence[DirectionalLight], ambient: ArrayLike) -> Fan:
    """A fan whose albedo is the picture lit with the captured normals; it holds for an instance that is not turned."""
    color = layers.color.copy()
    for pixels, normals, view in zip(color, layers.normal, fan.views, strict=True):
        light = np.broadcast_to(np.asarray(ambient, np.float32), (*normals.shape[:2], 3)).copy()
        for each in lights:
            facing = normals @ (view.basis @ each.toward).astype(np.float32)
            light += np.maximum(facing, 0)[..., None] * np.asarray(each.color, np.float32)
        lit = srgb_from_linear(linear_from_srgb(pixels[..., :3] / np.float32(255)) * light)
        pixels[..., :3] = np.rint(lit * 255)
    return replace(fan, color=color)
