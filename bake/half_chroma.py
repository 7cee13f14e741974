"""JPEGs whose colour is stored at half size, as most cameras write them: fitted as they are stored.

A polynomial of each stored plane is half the arithmetic of one of red, green and blue in every texel. What a decoder
does from there on is linear but for its clipping, so it can be done to the coefficients once instead of to every
photograph.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bake.one_pass import Bounds, Floats, blocks
from bake.photographs import Photographs
from impostor.ptm.polynomials import RGB_FROM_YCRCB, TERMS

CHROMA = ("Cr", "Cb")
NO_CHROMA = np.float32(128)
QUARTER = np.float32(0.25)
SQRT_3 = 3**0.5
BLOCK = 16_000  # texels: fewer would look at more rows of their neighbours'


@dataclass(frozen=True)
class HalfChroma:
    """Photographs of which `half_chroma` holds, each as a row of values: its luma, then Cr and Cb of half its size.

    Parameters
    ----------
    photographs : Photographs
    """

    photographs: Photographs

    def __len__(self) -> int:
        return len(self.photographs)

    @property
    def values(self) -> int:
        """Values in one photograph."""
        width, height = self.photographs.size
        return width * height + len(CHROMA) * (width // 2) * (height // 2)

    def memory(self, *lead: int) -> NDArray[np.uint8]:
        """Room for decoded photographs: (*lead, values)."""
        return np.empty((*lead, self.values), np.uint8)

    def decode(self, index: int, out: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The values of one photograph, in `out`.

        Raises
        ------
        PhotographError
            The file is truncated or damaged.

        Notes
        -----
        At half size a JPEG decoder has no need to enlarge the colour, so it gives what is stored; the luma of that size
        is left. That and luma alone at full size take no longer than one whole picture.
        """
        width, height = self.photographs.size
        texels = width * height
        with self.photographs.opened(index, "L", 1) as image:
            out[:texels] = np.frombuffer(image.tobytes(), np.uint8)
        with self.photographs.opened(index, "YCbCr", 2) as image:
            for name, plane in zip(CHROMA, out[texels:].reshape(len(CHROMA), -1), strict=True):
                plane[:] = np.frombuffer(image.tobytes("raw", name), np.uint8)
        return out


class HalfChromaCoefficients:
    """The coefficients of `HalfChroma`, whose blocks are those of three channels of every texel.

    Parameters
    ----------
    planes : ndarray of shape (6, values), float32
        As `accumulate` gives them.
    photographs : Photographs
    solver : ndarray of shape (6, N), float32
        As `accumulate` had it.

    Attributes
    ----------
    axes : ndarray of shape (3, 3), float32
        The axes, in columns, as red, green and blue: orthonormal, gray first.
    """

    def __init__(self, planes: Floats, photographs: Photographs, solver: Floats):
        self._size = width, height = photographs.size
        self._luma = planes[:, : width * height].reshape(TERMS, height, width)
        self._chroma = planes[:, width * height :].reshape(TERMS, len(CHROMA), height // 2, width // 2)
        self._no_chroma = NO_CHROMA * solver.sum(axis=1)[:, None, None, None]
        # Chroma moves red, green and blue together, along gray, and apart, along two more axes.
        colors = RGB_FROM_YCRCB[:, 1:3]
        together = colors.mean(axis=0)
        tints, self._tints_from_chroma = np.linalg.qr(colors - together)
        self._gray_from_tints = (SQRT_3 * together @ np.linalg.inv(self._tints_from_chroma)).astype(np.float32)
        self.axes = np.column_stack([np.full(3, 1 / SQRT_3), tints]).astype(np.float32)

    @property
    def blocks(self) -> list[Bounds]:
        """Blocks of texels, whole pairs of rows."""
        width, height = self._size
        return blocks(width * height, 2 * width * max(BLOCK // (2 * width), 1))

    def block(self, start: int, stop: int, out: Floats) -> None:
        """Put coefficients of a block of texels along the three axes in an array (6, 3, n).

        Colour is enlarged as libjpeg does it: three quarters of the nearer one, one of the farther one, each way.
        """
        width, height = self._size
        top, bottom = start // (2 * width), stop // (2 * width)
        rows = self._chroma[:, :, np.arange(top - 1, bottom + 1).clip(0, height // 2 - 1)]
        small = np.einsum("ij,tjhw->tihw", self._tints_from_chroma.astype(np.float32), rows - self._no_chroma)
        tall = np.empty((TERMS, len(CHROMA), bottom - top, 2, width // 2), np.float32)
        step = (small[:, :, 1:] - small[:, :, :-1]) * QUARTER
        np.subtract(small[:, :, 1:-1], step[:, :, :-1], out=tall[:, :, :, 0])
        np.add(small[:, :, 1:-1], step[:, :, 1:], out=tall[:, :, :, 1])
        tall = tall.reshape(TERMS, len(CHROMA), -1, width // 2)
        whole = out.reshape(TERMS, 3, -1, width)
        gray, tints = whole[:, 0], whole[:, 1:]
        step = (tall[..., 1:] - tall[..., :-1]) * QUARTER
        np.subtract(tall[..., 1:], step, out=tints[..., 2::2])
        np.add(tall[..., :-1], step, out=tints[..., 1:-1:2])
        tints[..., 0], tints[..., -1] = tall[..., 0], tall[..., -1]
        np.einsum("i,tihw->thw", self._gray_from_tints, tints, out=gray)
        gray += self._luma[:, 2 * top : 2 * bottom] * np.float32(SQRT_3)
