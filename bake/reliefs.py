"""Reliefs to photograph, from a height picture or a mesh; and their photographs as a capture set on disk."""

from __future__ import annotations

import os
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from bake.photographs import open_photographs
from bake.synthetic_capture import LARGEST_SIDE, Relief
from impostor.errors import SettingsError
from impostor.files.lp_file import CaptureSet, write_lp
from impostor.files.output import atomic_output, check_output
from impostor.model import Model
from impostor.srgb import linear_from_srgb, srgb_from_linear
from impostor.views import basis_facing, direction, frame

SIDES = {"front": (0.0, 0.0), "top": (0.0, np.pi / 2)}  # azimuth and elevation of the camera
GRAY = 0.6  # linear albedo where none is given
SMALLEST_SIZE = 16


def relief_of_picture(
    path: str | os.PathLike[str],
    depth: float,
    albedo: str | os.PathLike[str] | None = None,
    gloss: tuple[float, float] = (0.0, 60.0),
) -> Relief:
    """A relief whose heights are the values of a picture.

    Parameters
    ----------
    path : path-like
        8 or 16 bits; black is lowest.
    depth : float
        Height of white above black, in texels.
    albedo : path-like, optional
        A picture of the same size, sRGB; even gray if not given.
    gloss : tuple of float
        As `Relief`: strength and exponent.

    Returns
    -------
    Relief

    Raises
    ------
    PhotographError
        A picture that cannot be read.
    SettingsError
        A size or number out of range.
    """
    if not 0 < depth <= LARGEST_SIDE:
        raise SettingsError("depth", f"{depth:g} texels; expected above 0, at most {LARGEST_SIDE}")
    picture = open_photographs([path])
    heights = picture.decode(0).mean(axis=-1) * (depth / picture.white)
    colors = np.full((*heights.shape, 3), GRAY)
    if albedo is not None:
        painted = open_photographs([albedo])
        if painted.size != picture.size:
            raise SettingsError(
                str(albedo), f"is {painted.size[0]}x{painted.size[1]}; expected {picture.size[0]}x{picture.size[1]}"
            )
        colors = np.broadcast_to(linear_from_srgb(painted.decode(0) / painted.white), colors.shape)
    return Relief(heights, colors, *gloss)


def relief_of_model(model: Model, size: int, side: str = "front", gloss: tuple[float, float] = (0.0, 60.0)) -> Relief:
    """A relief of what an orthographic camera sees of a mesh.

    Parameters
    ----------
    model : Model
    size : int
        Side of the square picture in texels.
    side : {"front", "top"}
        Where the camera stands: at +Z, or at +Y with -Z up in the picture.
    gloss : tuple of float
        As `Relief`: strength and exponent.

    Returns
    -------
    Relief
        Black where nothing is seen.

    Raises
    ------
    SettingsError
        A choice out of range, or nothing is seen.
    GpuError
        No OpenGL context.
    """
    if side not in SIDES:
        raise SettingsError("side", f"{side!r}; expected {' or '.join(SIDES)}")
    if not SMALLEST_SIZE <= size <= LARGEST_SIDE:
        raise SettingsError("size", f"{size} texels; expected {SMALLEST_SIZE} to {LARGEST_SIDE}")
    from bake.capture import Capture
    from bake.resolve import resolve

    points = np.concatenate([part.positions for part in model.primitives])
    view = frame(basis_facing(direction(*SIDES[side]))[None], points, size)[0]
    with Capture(model, size) as capture:
        layers = resolve(capture.view(view), capture.samples)
    seen = layers.coverage > 0
    if not seen.any():
        raise SettingsError("model", f"nothing of it is seen from {side}")
    low, high = view.depth_range
    heights = layers.depth.astype(np.float64) * (high - low) * size / (2 * view.radius)
    heights[~seen] = heights[seen].min()
    albedo = linear_from_srgb(layers.color[..., :3] / 255) * (layers.color[..., 3:] / 255)
    return Relief(heights - heights.min(), albedo, *gloss)


def photograph_paths(lp: str | os.PathLike[str], count: int, quality: int | None = None) -> tuple[Path, ...]:
    """Where `write_capture` puts so many photographs."""
    lp, digits, suffix = Path(lp), len(str(count - 1)), ".png" if quality is None else ".jpg"
    return tuple(lp.with_name(f"{lp.stem}_{number:0{digits}}{suffix}") for number in range(count))


def write_capture(
    pictures: Sequence[NDArray[Any]],
    lights: ArrayLike,
    lp: str | os.PathLike[str],
    *,
    quality: int | None = None,
    force: bool = False,
) -> CaptureSet:
    """Write photographs beside the `.lp` file that names them: a whole set, or nothing of it.

    Parameters
    ----------
    pictures : sequence of ndarray of shape (H, W, 3), float
        Linear light; what passes 1 is clipped, as in a camera.
    lights : array_like of shape (N, 3), float
    lp : path-like
        Photographs are named after it: `dome.lp` has `dome_00.png` and so on.
    quality : int, optional
        Of JPEG, 1..100; PNG if not given.
    force : bool
        Replace existing files.

    Returns
    -------
    CaptureSet

    Raises
    ------
    OutputError
    """
    lp = Path(lp)
    paths = photograph_paths(lp, len(pictures), quality)
    for path in (lp, *paths):
        check_output(path, force)
    encoded = [_encoded(picture, quality) for picture in pictures]
    capture, written = CaptureSet(paths, np.asarray(lights, np.float64)), list[Path]()
    try:
        for path, data in zip(paths, encoded, strict=True):
            with atomic_output(path, force) as temporary:
                temporary.write_bytes(data)
            written.append(path)
        write_lp(capture, lp, force)
    except BaseException:
        # Neither a part of a set may stay, nor an older `.lp` that now names photographs of two.
        for path in (*written, lp) if written else ():
            path.unlink(missing_ok=True)
        raise
    return capture


def _encoded(picture: NDArray[Any], quality: int | None) -> bytes:
    """A picture of linear light as PNG or JPEG."""
    stored, file = Image.fromarray(np.rint(srgb_from_linear(picture) * 255).astype(np.uint8)), BytesIO()
    if quality is None:
        stored.save(file, "PNG")
    else:
        stored.save(file, "JPEG", quality=quality, subsampling=0)
    return file.getvalue()
