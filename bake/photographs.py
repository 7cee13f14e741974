"""Photographs of one object under many lights: opened and checked, then decoded a batch at a time in worker threads."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from impostor.errors import PhotographError

FORMATS = ("JPEG", "PNG", "TIFF", "TGA", "BMP", "PPM", "WEBP")
MAX_TEXELS = 80_000_000  # a fit holds 72 bytes a texel: what a header may ask for has an end
BAND = 128  # rows copied at a time, measured
AHEAD = 4  # photographs of the next batch, so that no thread waits for the last one of a batch
ORIENTATION = 0x0112  # the EXIF tag
TURNS = {
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_270,
    7: Image.Transpose.TRANSVERSE,
    8: Image.Transpose.ROTATE_90,
}
YCBCR_420 = [(1, 2, 2), (2, 1, 1), (3, 1, 1)]  # a JPEG's components: name, samples across and down
SIDEWAYS = {TURNS[tag] for tag in (5, 6, 7, 8)}
GRAY_MODES = ("1", "L", "LA", "La")
DEEP_MODES = ("I;16", "I;16B", "I;16L", "I;16N", "I")


@dataclass(frozen=True)
class Photographs:
    """The photographs of a capture set, not yet decoded.

    Parameters
    ----------
    paths : tuple of Path
    size : tuple of int
        Width and height, the same for all, after `turn`.
    channels : {1, 3}
        1 where every photograph is gray.
    dtype : {uint8, uint16}
    turn : Image.Transpose, optional
        What turns the stored pixels upright.
    half_chroma : bool
        Whether every one is a JPEG in YCbCr of even sides whose colour has half of its size.
    """

    paths: tuple[Path, ...]
    size: tuple[int, int]
    channels: int
    dtype: np.dtype[Any]
    turn: Image.Transpose | None = None
    half_chroma: bool = False

    def __len__(self) -> int:
        return len(self.paths)

    @property
    def white(self) -> int:
        """The stored value of white."""
        return int(np.iinfo(self.dtype).max)

    @property
    def values(self) -> int:
        """Values in one photograph: texels times channels."""
        return self.size[0] * self.size[1] * self.channels

    def memory(self, *lead: int) -> NDArray[Any]:
        """Room for decoded photographs: (*lead, H, W, C), where each channel is a plane."""
        planes = np.empty((*lead, self.channels, self.size[1], self.size[0]), self.dtype)
        return np.moveaxis(planes, -3, -1)

    def decode(self, index: int, out: NDArray[Any] | None = None) -> NDArray[Any]:
        """The pixels of one photograph.

        Parameters
        ----------
        index : int
        out : ndarray of shape (H, W, C), uint8 or uint16, optional
            Where to put them. Memory that is used again costs much less than new memory; and memory that holds one
            channel after the other, as new memory does, less than other memory.

        Returns
        -------
        ndarray of shape (H, W, C), uint8 or uint16
            `out`, where it was given.

        Raises
        ------
        PhotographError
            The file is truncated or damaged.
        """
        if out is None:
            out = self.memory()
        with self.opened(index) as image:
            self._copy(image, out)
        return out

    @contextmanager
    def opened(self, index: int, mode: str | None = None, part: int = 1) -> Iterator[Image.Image]:
        """One photograph, decoded and upright.

        Parameters
        ----------
        index : int
        mode : {"L", "YCbCr"}, optional
            Of a JPEG in YCbCr: what to take of it.
        part : {1, 2}
            Of such a JPEG: its whole size, or half.

        Raises
        ------
        PhotographError
            The file is truncated or damaged.
        """
        path, size = self.paths[index], (self.size[0] // part, self.size[1] // part)
        try:
            with _opened(path) as image:
                if mode is not None:
                    image.draft(mode, (image.width // part, image.height // part))
                image.load()
                upright = image if self.turn is None else image.transpose(self.turn)
                if upright.size != size or mode not in (None, upright.mode):
                    raise ValueError(
                        f"is {upright.mode} {upright.size[0]}x{upright.size[1]}; expected {size[0]}x{size[1]}"
                    )
                yield upright
        except (PhotographError, MemoryError):
            raise
        except Exception as error:  # Pillow promises no closed list of exceptions for a damaged image
            raise PhotographError(path, f"cannot be decoded: {error or type(error).__name__}") from error

    def _copy(self, image: Image.Image, out: NDArray[Any]) -> None:
        """Copy pixels, a band at a time: Pillow's way to NumPy makes two copies, which so stay in the cache."""
        wanted = "L" if self.channels == 1 else "RGB"
        width, height = image.size
        for top in range(0, height, BAND):
            band = image.crop((0, top, width, min(top + BAND, height)))
            if band.mode in DEEP_MODES:
                deep = np.asarray(band).astype(np.int64).clip(0, 65535)[..., None]
                out[top : top + BAND] = deep if self.dtype == np.uint16 else deep >> 8
                continue
            band = band if band.mode == wanted else band.convert(wanted)
            for channel, name in enumerate(wanted):
                pixels = np.frombuffer(band.tobytes("raw", name), np.uint8).reshape(-1, width)
                # 257 takes 255 to 65535: an 8-bit photograph among 16-bit ones.
                scaled = pixels if self.dtype == np.uint8 else pixels.astype(np.uint16) * 257
                out[top : top + BAND, :, channel] = scaled


def open_photographs(paths: Sequence[str | os.PathLike[str]]) -> Photographs:
    """Read the headers of a capture set's photographs and check that they belong together.

    The camera stood still, so the pixels of all photographs lie on one another as they are stored. The EXIF
    orientation of the first is taken for all: a camera that looks straight down notes a different one at random.

    Parameters
    ----------
    paths : sequence of path-like

    Returns
    -------
    Photographs

    Raises
    ------
    PhotographError
        No photographs, a file that is missing or not an image, sizes that differ or are out of bounds.
    """
    if not paths:
        raise PhotographError("capture set", "holds no photographs; expected at least one")
    files = tuple(map(Path, paths))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Pillow warns of large images; here they are refused
        headers = [_header(path) for path in files]
        turn = _turn(files[0])
    first = headers[0][0]
    for path, (size, mode, _) in zip(files, headers, strict=True):
        if size != first:
            raise PhotographError(
                path, f"is {size[0]}x{size[1]}; expected {first[0]}x{first[1]} as {str(files[0].name)!r} is"
            )
        if mode == "F":
            raise PhotographError(path, "holds floating-point pixels; expected 8 or 16 bits a channel")
    if first[0] * first[1] > MAX_TEXELS:
        raise PhotographError(files[0], f"is {first[0]}x{first[1]}; expected at most {MAX_TEXELS:,} pixels")
    modes = {mode for _, mode, _ in headers}
    gray = all(mode in (*GRAY_MODES, *DEEP_MODES) for mode in modes)
    dtype = np.dtype(np.uint16 if gray and any(mode in DEEP_MODES for mode in modes) else np.uint8)
    upright = (first[1], first[0]) if turn in SIDEWAYS else first
    half_chroma = not (first[0] % 2 or first[1] % 2) and all(halved for *_, halved in headers)
    return Photographs(files, upright, 1 if gray else 3, dtype, turn, half_chroma)


class Source(Protocol):
    """What `decoded` decodes: `Photographs`, or what else has photographs in an order."""

    def __len__(self) -> int: ...
    def memory(self, *lead: int) -> NDArray[Any]: ...
    def decode(self, index: int, out: NDArray[Any]) -> NDArray[Any]: ...


def decoded(
    photographs: Source,
    pool: ThreadPoolExecutor,
    batch: int,
    progress: Callable[[int, int], None] | None = None,
) -> Iterator[tuple[NDArray[np.int64], NDArray[Any]]]:
    """All photographs in batches; while one is worked on, threads begin to decode the next.

    Parameters
    ----------
    photographs : Photographs or HalfChroma
    pool : ThreadPoolExecutor
        Where they are decoded; Pillow lets other threads run meanwhile.
    batch : int
        How many photographs a batch has at most; `AHEAD` more are in memory. Batches are about of one size, whatever
        the threads are.
    progress : callable, optional
        Called with photographs decoded and photographs in all.

    Yields
    ------
    indices : ndarray of shape (K,), int64
    pixels : ndarray of shape (K, H, W, C), uint8 or uint16, or (K, values)
        As their `memory` has it: each channel of each photograph is a plane. Written over by the next batch.

    Raises
    ------
    PhotographError
        As `Photographs.decode`.
    """
    # Not a multiple of the threads: sums over batches would round otherwise on a machine with more of them.
    step = -(-len(photographs) // -(-len(photographs) // batch))
    memory = photographs.memory(step + min(AHEAD, step))
    batches: list[tuple[NDArray[np.int64], range]] = []
    for start in range(0, len(photographs), step):
        size = min(step, len(photographs) - start)
        # In turns at the start of the memory and at its end: what one batch leaves free is the next one's.
        first = (len(batches) % 2) * (len(memory) - size)
        batches.append((np.arange(start, start + size), range(first, first + size)))
    decoding: dict[int, Future[Any]] = {}

    def begin(indices: NDArray[np.int64], places: range, taken: range) -> None:
        for index, place in zip(indices.tolist(), places, strict=True):
            if index not in decoding and place not in taken:
                decoding[index] = pool.submit(photographs.decode, index, memory[place])

    try:
        for number, (indices, places) in enumerate(batches):
            begin(indices, places, range(0))
            for following in batches[number + 1 : number + 2]:
                begin(*following, taken=places)
            for index in indices.tolist():
                decoding.pop(index).result()
                if progress is not None:
                    progress(index + 1, len(photographs))
            yield indices, memory[places.start : places.stop]
    finally:
        for each in decoding.values():
            each.cancel()


def _header(path: Path) -> tuple[tuple[int, int], str, bool]:
    """Size and mode, and whether it is a JPEG in YCbCr whose colour has half of its size."""
    with _opened(path) as image:
        components = [layer[:3] for layer in getattr(image, "layer", ())]
        halved = components == YCBCR_420 and image.info.get("adobe_transform", 1) == 1
        return image.size, image.mode, halved


def _turn(path: Path) -> Image.Transpose | None:
    with _opened(path) as image:
        try:
            if image.format == "PNG":  # getexif would decode the whole picture to look behind it
                exif = Image.Exif()
                exif.load(image.info.get("exif", b""))
            else:
                exif = image.getexif()
            return TURNS.get(exif.get(ORIENTATION, 1))
        except Exception:  # a damaged note on how the camera was held is no reason to refuse its picture
            return None


def _opened(path: Path) -> Image.Image:
    try:
        return Image.open(path, formats=FORMATS)
    except FileNotFoundError:
        raise PhotographError(path, "does not exist; expected a photograph") from None
    except OSError as error:
        if error.errno is not None:
            raise PhotographError(path, f"cannot be read: {error.strerror}") from error
        raise PhotographError(path, f"is not an image; expected one of {', '.join(FORMATS)}") from error
    except Exception as error:
        raise PhotographError(path, f"cannot be read: {error or type(error).__name__}") from error
