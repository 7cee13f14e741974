"""Pictures of linear light: .hdr and .exr, and the .png, .jpg and .tif files that stand in for them."""

from __future__ import annotations

import errno
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from impostor.environment.environment import MAX_FACE
from impostor.errors import EnvironmentFileError
from impostor.srgb import linear_from_srgb, srgb_from_linear

FilePath = str | PathLike[str]

KINDS = {
    "HDR": (b"#?",),
    "EXR": (b"\x76\x2f\x31\x01",),
    "PNG": (b"\x89PNG",),
    "JPEG": (b"\xff\xd8\xff",),
    "TIFF": (b"II*\x00", b"MM\x00*"),
}
"""What files of each kind begin with; the name does not count."""
READ = (".hdr", ".pic", ".exr", ".png", ".jpg", ".jpeg", ".tif", ".tiff")
WRITTEN = (".hdr", ".exr", ".png")
LARGEST_SIDE = 4 * MAX_FACE
RINGING = 0.01  # of the mean radiance; 0.003 was the most in three panoramas that a modelling program ships
LOSSY = ("b44", "dwa")
PRIMARIES = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)


def read_radiance(path: FilePath) -> NDArray[np.float32]:
    """The light in a picture.

    Numbers in floating point are linear light. Whole numbers, 8 or 16 bits, are on the sRGB curve and give light from
    0 to 1. Of more than three channels the first three count, one or two are grey; alpha does not count.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    ndarray, (H, W, 3) float32
        Finite, at least 0. Slight negative numbers, up to 1 % of the mean, are 0 where lossy compression makes them.

    Raises
    ------
    EnvironmentFileError
        No such picture, one that is truncated, too large or in other primaries, or a texel that is negative or not
        finite.
    """
    with _opened(path) as (source, spec, kind):
        texels = source.read_image(0, 0, 0, min(spec.nchannels, 3), "float")
        problem = _problem(source)  # a truncated JPEG gives a picture all the same
    if texels is None or problem:
        raise EnvironmentFileError(path, _unreadable(kind, problem))
    texels = np.asarray(texels, np.float32).reshape(spec.height, spec.width, -1)
    texels = _upright(texels if texels.shape[2] == 3 else texels[..., :1].repeat(3, axis=2), spec)
    if str(spec.format) in ("uint8", "uint16"):
        return linear_from_srgb(texels)
    with np.errstate(all="ignore"):  # Radiance files say by how much their numbers were multiplied
        texels = texels / np.float32(spec.getattribute("hdr:exposure") or 1)
    _refuse(path, texels, ~np.isfinite(texels), "not finite")
    if str(spec.getattribute("compression") or "").startswith(LOSSY) and texels.min() >= -RINGING * texels.mean():
        texels = np.maximum(texels, 0)
    _refuse(path, texels, texels < 0, "negative")
    return texels


def picture_size(path: FilePath) -> tuple[int, int]:
    """Width and height of a picture as its header says.

    Raises
    ------
    EnvironmentFileError
        As `read_radiance`, as far as can be told without texels.
    """
    with _opened(path) as (_, spec, _):
        turned = int(spec.getattribute("Orientation") or 1) >= 5
        return (spec.height, spec.width) if turned else (spec.width, spec.height)


def write_radiance(path: Path, texels: NDArray[np.float32]) -> None:
    """Write (H, W, 3) linear light, over what there is; callers make it atomic.

    ".png" keeps light from 0 to 1 in 8 bits on the sRGB curve, ".hdr" 8 bits of mantissa, ".exr" everything.

    Raises
    ------
    OSError
        The disk is full or the like.
    """
    suffix = path.suffix.lower()
    if suffix == ".png":
        Image.fromarray(np.rint(srgb_from_linear(texels) * 255).astype(np.uint8)).save(path, format="PNG")
        return
    spec = oiio.ImageSpec(texels.shape[1], texels.shape[0], 3, "float")
    if suffix == ".hdr":
        # The mantissas are cut off, not rounded: half of their last digit keeps the mean where it is.
        largest = texels.max(axis=2, keepdims=True)
        for _ in range(2):  # a number that is rounded up to a power of two has larger digits
            half = np.ldexp(np.float32(0.5), np.frexp(largest)[1] - 8)
            largest = largest + half
        texels = np.where(texels > 0, texels + half, 0)
    else:
        spec.attribute("compression", "zip")
        spec.attribute("DateTime", "")  # the same light gives the same bytes
        spec.attribute("chromaticities", oiio.TypeDesc("float[8]"), PRIMARIES)
    output = oiio.ImageOutput.create(f"light{suffix}")
    if not (
        output
        and output.open(str(path), spec)
        and output.write_image(np.ascontiguousarray(texels, np.float32))
        and output.close()
    ):
        raise OSError(errno.EIO, _first_words(_problem(output)) if output else "no encoder")


@contextmanager
def _opened(path: FilePath) -> Iterator[tuple[oiio.ImageInput, oiio.ImageSpec, str]]:
    """A picture's decoder, what its header says, which has been checked, and its kind."""
    kind = _kind(path)
    asked = oiio.ImageSpec()
    asked.attribute("oiio:UnassociatedAlpha", 1)
    source = oiio.ImageInput.open(str(path), asked)
    if source is None:
        raise EnvironmentFileError(path, _unreadable(kind, _problem(oiio)))
    try:
        spec = source.spec()
        _check_spec(path, spec)
        yield source, spec, kind
    finally:
        source.close()


def _kind(path: FilePath) -> str:
    """What a file is by its first bytes; a PNG is sound too, as its decoder prints what it finds wrong."""
    try:
        if not Path(path).is_file():
            problem = "is a directory or no ordinary file" if Path(path).exists() else "does not exist"
            raise EnvironmentFileError(path, f"{problem}; expected an .hdr or .exr file")
        with open(path, "rb") as file:
            start = file.read(4)
    except OSError as error:
        raise EnvironmentFileError(path, f"cannot be read: {error.strerror}; expected a file that can") from error
    if not start:
        raise EnvironmentFileError(path, "is empty; expected a picture")
    kind = next((kind for kind, starts in KINDS.items() if start.startswith(starts)), None)
    if kind is None:
        raise EnvironmentFileError(path, f"begins with {start!r}; expected an HDR, EXR, PNG, JPEG or TIFF picture")
    if kind == "PNG":
        try:
            with warnings.catch_warnings(), Image.open(path) as image:
                warnings.simplefilter("ignore")
                image.verify()
        except (UnidentifiedImageError, Image.DecompressionBombError, OSError, SyntaxError, ValueError) as error:
            raise EnvironmentFileError(path, _unreadable(kind, str(error))) from error
    return kind


def _unreadable(kind: str, problem: str) -> str:
    return f"is truncated or damaged ({_first_words(problem) or 'no texels'}); expected a whole {kind} file"


def _problem(source: Any) -> str:
    """What went wrong last; it may quote bytes of a damaged file that are no text."""
    try:
        return source.geterror()
    except UnicodeDecodeError:
        return "bytes that are no text"


def _first_words(problem: str | None) -> str:
    """What a library says, up to the path that some put into it."""
    return (problem or "").strip().partition("\n")[0].split('"')[0].split(" (/")[0].strip(" (:")


def _check_spec(path: FilePath, spec: oiio.ImageSpec) -> None:
    """Refuse what a header says, before any texel is read."""
    width, height = spec.width, spec.height
    if not (0 < width <= LARGEST_SIDE and 0 < height <= LARGEST_SIDE):
        raise EnvironmentFileError(path, f"says it is {width}x{height}; expected sides up to {LARGEST_SIDE}")
    whole = spec.full_x, spec.full_y, spec.full_width, spec.full_height
    if (spec.x, spec.y, width, height) != whole:
        raise EnvironmentFileError(
            path, f"holds {width}x{height} texels of {whole[2]}x{whole[3]}; expected all of them"
        )
    primaries = spec.getattribute("chromaticities")
    if primaries and np.abs(np.subtract(primaries, PRIMARIES)).max() > 0.02:
        red = "{:.3g}, {:.3g}".format(*primaries[:2])
        raise EnvironmentFileError(path, f"has its red primary at {red}; expected those of sRGB, red at 0.64, 0.33")
    exposure = spec.getattribute("hdr:exposure")
    if exposure is not None and not 0 < exposure < np.inf:
        raise EnvironmentFileError(path, f"header's EXPOSURE is {exposure}; expected a number above 0")


def _upright(texels: NDArray[np.float32], spec: oiio.ImageSpec) -> NDArray[np.float32]:
    """Turned as the file asks for: EXIF's eight ways, which Radiance's headers are told in too."""
    way = int(spec.getattribute("Orientation") or 1)
    if way >= 5:
        texels = texels.swapaxes(0, 1)
    if way in (2, 3, 6, 7):
        texels = texels[:, ::-1]
    if way in (3, 4, 7, 8):
        texels = texels[::-1]
    return texels


def _refuse(path: FilePath, texels: NDArray[np.float32], wrong: NDArray[np.bool_], name: str) -> None:
    if not wrong.any():
        return
    texel = wrong.any(axis=2)
    row, column = np.unravel_index(texel.argmax(), texel.shape)
    value = texels[row, column][wrong[row, column]][0]
    count = np.count_nonzero(texel)
    found = f"{count} {'texel is' if count == 1 else 'texels are'} {name}, the first in row {row}, column {column}"
    raise EnvironmentFileError(path, f"{found} ({value:g}); expected radiance of at least 0")
