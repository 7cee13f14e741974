"""The JPEG planes of a compressed `.ptm` file: prediction of a plane by another, inversion and side information.

Planes are in the file's order of rows here, bottom row first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from io import BytesIO
from itertools import pairwise
from os import PathLike

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.JpegImagePlugin import JpegImageFile

from impostor.errors import PtmFileError
from impostor.files.ptm_header import SIDE_RECORD, PlaneEntry

Plane = NDArray[np.uint8]
Reference = tuple[int, bool]  # which plane, -1 for none; whether it is inverted
ALONE: Reference = (-1, False)
MIDDLE = 128
THREADS = 2
# A side record of 5 bytes pays where it removes more squared error than 5 more bytes of JPEG would: at 6 dB a bit
# those remove 5 * 16 ln 2 times the mean squared error.
RECORD_PAYS = (5 * 16 * np.log(2)) ** 0.5
SAMPLE_BLOCK, SAMPLE_BLOCKS = 64, 5  # Reference planes are chosen on 5 x 5 blocks of 64 x 64 texels of a larger map.


@dataclass(frozen=True)
class EncodedPlane:
    """One plane's bytes, and what the header has to say of it; `decoded` is what a reader gets."""

    jpeg: bytes
    side: bytes
    rank: int
    reference: int
    inverted: bool
    decoded: Plane

    @property
    def entry(self) -> PlaneEntry:
        """Its column of the header."""
        return PlaneEntry(self.rank, self.reference, self.inverted, len(self.jpeg), len(self.side))


def decode_planes(
    data: bytes, body: int, entries: Sequence[PlaneEntry], size: tuple[int, int], path: str | PathLike[str]
) -> list[Plane]:
    """Decode all planes of a file whose header has been checked.

    Parameters
    ----------
    data : bytes
        The file.
    body : int
        Where its first plane begins.
    entries : sequence of PlaneEntry
    size : tuple of int
        Width and height in texels.
    path : path-like
        For messages.

    Returns
    -------
    list of ndarray of shape (H, W), uint8

    Raises
    ------
    PtmFileError
    """
    lengths = [length for entry in entries for length in (entry.jpeg_bytes, entry.side_bytes)]
    ends = body + np.cumsum([0, *lengths])
    parts = [data[start:end] for start, end in pairwise(ends)]

    def unpack(index: int) -> Plane:
        try:
            return _decode_jpeg(parts[2 * index], size)
        except Exception as error:  # Pillow promises no closed list of exceptions for a damaged image
            raise PtmFileError(path, f"plane {index}: {error or type(error).__name__}") from error

    with ThreadPoolExecutor(THREADS) as pool:
        planes = list(pool.map(unpack, range(len(entries))))
    for index in sorted(range(len(entries)), key=lambda index: entries[index].rank):
        entry = entries[index]
        if entry.reference >= 0:
            planes[index] = _add_reference(planes[index], planes[entry.reference], entry.inverted)
        records = np.frombuffer(parts[2 * index + 1], SIDE_RECORD)
        if len(records) and records["index"].max() >= planes[index].size:
            place = f"plane {index}: side information for texel {records['index'].max()}"
            raise PtmFileError(path, f"{place}; expected less than {planes[index].size}")
        planes[index].reshape(-1)[records["index"]] = records["value"]
    return planes


def encode_planes(
    planes: Sequence[Plane], quality: int, predict: bool, progress: Callable[[int, int], None] | None = None
) -> list[EncodedPlane]:
    """Encode planes as grayscale JPEGs, each by itself or as its difference from another, whichever is smaller.

    Parameters
    ----------
    planes : sequence of ndarray of shape (H, W), uint8
    quality : int
        Of JPEG, 1..100.
    predict : bool
        Allow differences.
    progress : callable, optional
        Called with planes encoded and planes in all.

    Returns
    -------
    list of EncodedPlane
        In the order of the planes.

    Notes
    -----
    Reference planes are the spanning arborescence of least bytes, measured by encoding every difference. A plane
    differs from its reference as that comes out of the decoder, so that errors do not add up.
    """
    references = _choose_references(planes, quality) if predict else [ALONE] * len(planes)
    done: dict[int, EncodedPlane] = {}
    with ThreadPoolExecutor(THREADS) as pool:
        while len(done) < len(planes):
            ready = [
                index
                for index, (reference, _) in enumerate(references)
                if index not in done and (reference < 0 or reference in done)
            ]
            encoding = pool.map(lambda index: _smallest(planes[index], references[index], done, quality), ready)
            encoded = []
            for one in encoding:
                encoded.append(one)
                if progress is not None:
                    progress(len(done) + len(encoded), len(planes))
            for index, (jpeg, side, (reference, inverted), decoded) in zip(ready, encoded, strict=True):
                done[index] = EncodedPlane(jpeg, side, len(done), reference, inverted, decoded)
    return [done[index] for index in range(len(planes))]


def _smallest(
    plane: Plane, choice: Reference, done: dict[int, EncodedPlane], quality: int
) -> tuple[bytes, bytes, Reference, Plane]:
    """JPEG, side information, reference and decoded plane: with the reference or alone, whichever takes fewer bytes."""
    jpeg, side, decoded = _encode(plane, None, quality)
    reference, inverted = choice
    if reference >= 0:
        other_jpeg, other_side, other = _encode(plane, _turned(done[reference].decoded, inverted), quality)
        if len(other_jpeg) + len(other_side) < len(jpeg) + len(side):
            return other_jpeg, other_side, choice, other
    return jpeg, side, ALONE, decoded


def _encode(plane: Plane, reference: Plane | None, quality: int) -> tuple[bytes, bytes, Plane]:
    """JPEG, side information and what both decode to."""
    # uint8 arithmetic is modulo 256, as the format asks.
    jpeg = _encode_jpeg(plane if reference is None else plane - reference + np.uint8(MIDDLE), quality)
    decoded = _decode_jpeg(jpeg, plane.shape[::-1])
    if reference is not None:
        decoded = decoded + reference - np.uint8(MIDDLE)
    wrong = _worth_a_record(plane, decoded, reference is not None)
    records = np.empty(np.count_nonzero(wrong), SIDE_RECORD)
    records["index"], records["value"] = np.flatnonzero(wrong), plane[wrong]
    decoded[wrong] = plane[wrong]
    return jpeg, records.tobytes(), decoded


def _worth_a_record(plane: Plane, decoded: Plane, predicted: bool) -> NDArray[np.bool_]:
    """Texels whose error is so large that five bytes of side information are well spent."""
    error = np.abs(plane.astype(np.int16) - decoded)
    # Without the errors of modulo 256, which say nothing of JPEG's.
    mean_square = np.mean(np.square(error, dtype=np.float64), where=error < MIDDLE) if (error < MIDDLE).any() else 0.0
    wrong = error > max(1.0, RECORD_PAYS * mean_square**0.5)
    if predicted:
        # A decoder that rounds the other way would wrap these from black to white.
        wrong |= (decoded == 0) | (decoded == 255)
    return wrong


def _choose_references(planes: Sequence[Plane], quality: int) -> list[Reference]:
    """The reference of every plane (-1 for none) and whether it is inverted, so that all take the fewest bytes."""
    sample = [_sample(plane) for plane in planes]
    count = len(planes)

    def bytes_of(choice: tuple[int, int, bool]) -> int:
        plane, reference, inverted = choice
        turned = None if reference < 0 else _turned(sample[reference], inverted)
        jpeg, side, _ = _encode(sample[plane], turned, quality)
        return len(jpeg) + len(side)

    choices = [
        (plane, reference, inverted)
        for plane in range(count)
        for reference in range(-1, count)
        if reference != plane
        for inverted in ((False,) if reference < 0 else (False, True))
    ]
    with ThreadPoolExecutor(THREADS) as pool:
        sizes = dict(zip(choices, pool.map(bytes_of, choices), strict=True))
    import networkx  # takes half of the time that a command needs to start

    graph = networkx.DiGraph()
    for plane, reference, _ in choices:
        inverted = reference >= 0 and sizes[plane, reference, True] < sizes[plane, reference, False]
        graph.add_edge(reference, plane, weight=sizes[plane, reference, inverted], inverted=inverted)
    tree = networkx.minimum_spanning_arborescence(graph, preserve_attrs=True)
    chosen = {plane: (reference, inverted) for reference, plane, inverted in tree.edges(data="inverted")}
    return [chosen[plane] for plane in range(count)]


def _sample(plane: Plane) -> Plane:
    """Some blocks of a large plane, evenly spread; a small one whole."""
    for axis in (0, 1):
        length = plane.shape[axis]
        if length > SAMPLE_BLOCK * SAMPLE_BLOCKS:
            starts = np.linspace(0, length - SAMPLE_BLOCK, SAMPLE_BLOCKS).astype(int) // 8 * 8
            plane = np.take(plane, (starts[:, None] + np.arange(SAMPLE_BLOCK)).ravel(), axis=axis)
    return plane


def _turned(reference: Plane, inverted: bool) -> Plane:
    return np.uint8(255) - reference if inverted else reference


def _add_reference(difference: Plane, reference: Plane, inverted: bool) -> Plane:
    return difference + _turned(reference, inverted) - np.uint8(MIDDLE)


def _encode_jpeg(plane: Plane, quality: int) -> bytes:
    file = BytesIO()
    Image.fromarray(plane).save(file, "JPEG", quality=quality, optimize=True)
    return file.getvalue()


def _decode_jpeg(jpeg: bytes, size: tuple[int, int]) -> Plane:
    # Not Image.open: its limit on pixels is global, and the size has been checked against stricter ones.
    with JpegImageFile(BytesIO(jpeg)) as image:
        if (image.size, image.mode) != (size, "L"):
            width, height = image.size
            raise ValueError(f"JPEG is {width} x {height} {image.mode}; expected {size[0]} x {size[1]} L")
        if image.info.get("progressive"):
            raise ValueError("JPEG is progressive; expected baseline")
        return np.array(image)
