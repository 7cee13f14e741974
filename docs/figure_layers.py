"""Figures of what a fan holds: its layers (3), its normal codes (5a, 5b) and its shadow strips (6b)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw

from docs.studio import INK, PAPER, Studio, captioned, to_bytes
from impostor.lighting import DirectionalLight
from impostor.normal_code import BACKGROUND, decode, dither, encode
from impostor.srgb import srgb_from_linear
from impostor.strips import silhouette_strips

LIGHT = DirectionalLight.from_angles(75, 35, (1.0, 0.98, 0.94))
AMBIENT = 0.06
STONE = (0.80, 0.77, 0.71)  # linear
SMOOTHING = 4  # samples along a pixel's side in drawings


def figure_3(studio: Studio) -> Image.Image:
    """The layers of one view of a uniform and of a textured model."""
    rows = []
    for name in ("statue", "house"):
        layers, _ = studio.exact_layers(name, 30, 224)
        covered = layers.coverage > 0
        codes = dither(layers.normal[None], covered[None])[0]
        alpha = layers.coverage[..., None]
        color = layers.color[..., :3] / 255 * alpha + (1 - alpha) * 0.25
        normal = np.where(covered[..., None], layers.normal / 2 + 0.5, 0)
        # Nearest to farthest part of the object, not of the view's whole range.
        nearness = np.where(covered, layers.depth, 0)
        farthest = layers.depth[covered].min()
        depth = np.where(covered, 0.15 + 0.85 * (nearness - farthest) / (nearness.max() - farthest), 0)
        silhouette = np.where(layers.coverage >= 0.5, 0.0, 1.0)
        grey = np.where(codes == BACKGROUND, 255, codes) / 255
        rows.append([_picture(layer) for layer in (color, normal, grey, depth, silhouette)])
    captions = ["colour", "normals", "normal codes, one byte", "depth", "silhouette"]
    return captioned(rows, [[""] * 5, captions])


def figure_5a(studio: Studio) -> Image.Image:
    """A view shaded with the nearest normal code of each pixel, and a part of it magnified."""
    layers, basis = studio.exact_layers("statue", 30, 400)
    codes = encode(layers.normal, layers.coverage > 0)
    return _figure_5(codes, basis, layers.coverage, "nearest of 225 normals")


def figure_5b(studio: Studio) -> Image.Image:
    """The same with dithered codes."""
    layers, basis = studio.exact_layers("statue", 30, 400)
    codes = dither(layers.normal[None], layers.coverage[None] > 0)[0]
    return _figure_5(codes, basis, layers.coverage, "dithered")


def _figure_5(
    codes: NDArray[np.uint8], basis: NDArray[np.float64], coverage: NDArray[np.float32], caption: str
) -> Image.Image:
    picture = _picture(_shaded(decode(codes), basis, coverage))
    part = (150, 240, 270, 380)
    close = picture.crop(part).resize((343, 400), Image.Resampling.NEAREST)
    ImageDraw.Draw(picture).rectangle(part, outline=(200, 60, 40))
    return captioned([[picture.crop((70, 0, 330, 400)), close]], [[caption, "magnified"]])


def _shaded(normals: NDArray[np.float32], basis: NDArray[np.float64], coverage: ArrayLike) -> NDArray[np.float64]:
    """Equation 1 over the page's colour: (H, W, 3) float, sRGB."""
    facing = np.maximum(normals @ (basis @ LIGHT.toward), 0)[..., None]
    alpha = np.asarray(coverage)[..., None]
    return srgb_from_linear(facing * LIGHT.color * STONE + AMBIENT) * alpha + (1 - alpha) * np.array(PAPER) / 255


def figure_6b(studio: Studio) -> Image.Image:
    """A silhouette's pixels, and the strips cut from it, drawn slightly apart."""
    silhouette = studio.fan("knot", 8, 28).silhouette[0]
    cell = 17 * SMOOTHING
    side = cell * len(silhouette)
    pixels, strips = (Image.new("RGB", (side, side), PAPER) for _ in range(2))
    draw = ImageDraw.Draw(pixels)
    for row, column in np.argwhere(silhouette).tolist():
        left, top = column * cell, row * cell
        draw.rectangle((left, top, left + cell, top + cell), PAPER, INK, SMOOTHING)
    _draw_strips(ImageDraw.Draw(strips), silhouette, cell)
    shown = [
        picture.resize((side // SMOOTHING, side // SMOOTHING), Image.Resampling.BOX) for picture in (pixels, strips)
    ]
    return captioned([shown], [["(a) pixels of a silhouette", "(b) its quadrilateral strips, drawn apart"]])


def _draw_strips(draw: ImageDraw.ImageDraw, silhouette: NDArray[np.bool_], cell: int) -> None:
    strips = silhouette_strips(silhouette)
    corners = strips.positions[strips.quads] * cell
    apart = cell * 0.09
    corners[:, :2, 0] += apart
    corners[:, 2:, 0] -= apart
    for quad in corners:
        draw.polygon([tuple(corner) for corner in quad], (196, 203, 212), INK, SMOOTHING // 2)


def _picture(values: NDArray[np.floating]) -> Image.Image:
    """(H, W) or (H, W, 3), 0 to 1."""
    pixels = to_bytes(values)
    return Image.fromarray(pixels if pixels.ndim == 3 else np.repeat(pixels[..., None], 3, axis=-1))
