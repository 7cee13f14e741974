"""Coefficients of every texel in one pass over the photographs, in memory that does not grow with their number."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from bake.photographs import Photographs, Source, decoded
from bake.small_products import multiply
from impostor.errors import SettingsError
from impostor.ptm.polynomials import TERMS, Curve
from impostor.srgb import linear_from_srgb

Bounds = tuple[int, int]
Floats = NDArray[np.float32]
# From coefficients (6, 3, n) of a few texels, with their axes (3, 3) and scratch memory (6, 3, n), to rows (R, n).
Turn = Callable[[Floats, Floats, Floats, Floats], None]

BATCH = 25  # photographs between two visits to the accumulators, which weigh as much as 24 of them
BLOCK = 6400  # texels at a time: fewer lose time between calls, more fall out of the cache
SLICES_A_WORKER = 4  # so that workers end together


class Coefficients(Protocol):
    """Fitted coefficients of three channels a texel, along axes that are orthonormal in red, green and blue."""

    axes: Floats  # (3, 3), in columns

    @property
    def blocks(self) -> list[Bounds]: ...
    def block(self, start: int, stop: int, out: Floats) -> None: ...


class PlanarCoefficients:
    """Coefficients (6, C, N), float32, one channel or three: red, green and blue themselves.

    Parameters
    ----------
    planes : ndarray of shape (6, C, N), float32
    turn : ndarray of shape (6, 6), float32, optional
        What turns them into what is wanted.
    """

    axes = np.eye(3, dtype=np.float32)

    def __init__(self, planes: Floats, turn: Floats | None = None):
        self.planes, self._turn = planes, turn

    @property
    def blocks(self) -> list[Bounds]:
        """Blocks of texels."""
        return blocks(self.planes.shape[2], BLOCK)

    def block(self, start: int, stop: int, out: Floats) -> None:
        """Put coefficients of a block of texels in an array (6, 3, n)."""
        if self._turn is None:
            np.copyto(out, self.planes[:, :, start:stop])
        else:
            np.einsum("st,tcn->scn", self._turn, self.planes[:, :, start:stop], out=out)


def accumulate(
    photographs: Source,
    solver: Floats,
    pool: ThreadPoolExecutor,
    table: Floats | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Floats:
    """Coefficients of every value of a photograph by linear least squares.

    Parameters
    ----------
    photographs : Photographs or HalfChroma
        N of them.
    solver : ndarray of shape (6, N), float32
        Coefficients are its product with a value in all photographs.
    pool : ThreadPoolExecutor
    table : ndarray of float32, optional
        What stored values stand for; themselves if not given.
    progress : callable, optional
        Called with photographs decoded and photographs in all.

    Returns
    -------
    ndarray of shape (6, values), float32
        In the order in which values lie in memory: of `Photographs`, channel after channel.

    Raises
    ------
    PhotographError

    Notes
    -----
    The pseudo-inverse of the lights' matrix is known before the first pixel is, so each photograph adds its share to
    the coefficients and is forgotten. Batches and blocks do not depend on the threads, nor then does any rounding.
    """
    planes: Floats | None = None
    for indices, pixels in decoded(photographs, pool, BATCH, progress):
        values = np.moveaxis(pixels, -1, 1).reshape(len(pixels), -1)  # a view
        begun = planes is not None
        if planes is None:
            planes = np.empty((TERMS, values.shape[1]), np.float32)
        _add_share(planes, values, np.ascontiguousarray(solver[:, indices]), table, begun, pool)
    assert planes is not None
    return planes


def _add_share(
    planes: Floats,
    batch: NDArray[Any],
    weights: Floats,
    table: Floats | None,
    begun: bool,
    pool: ThreadPoolExecutor,
) -> None:
    """Add what one batch (K, values) gives to coefficients (6, values), which begin with the first one's."""

    def work(bounds: Sequence[Bounds]) -> None:
        most = max(high - low for low, high in bounds)
        memory = np.empty((len(batch) + TERMS) * most, np.float32)
        for low, high in bounds:
            both = memory[: (len(batch) + TERMS) * (high - low)].reshape(-1, high - low)
            values, share, sums = both[: len(batch)], both[len(batch) :], planes[:, low:high]
            if table is None:
                np.copyto(values, batch[:, low:high])
            else:
                np.take(table, batch[:, low:high], out=values, mode="clip")
            multiply(weights, values, share)
            if begun:
                np.add(sums, share, out=sums)
            else:
                np.copyto(sums, share)

    in_slices(work, blocks(planes.shape[1], 3 * BLOCK), pool)


def turned(coefficients: Coefficients, turn: Turn, out: Floats, pool: ThreadPoolExecutor) -> Floats:
    """What is wanted of coefficients, block by block: rows (R, N), in `out`."""

    def work(bounds: Sequence[Bounds]) -> None:
        most = max(high - low for low, high in bounds)
        memory = np.empty(2 * TERMS * 3 * most, np.float32)
        for low, high in bounds:
            both = memory[: 2 * TERMS * 3 * (high - low)].reshape(-1, 3, high - low)
            coefficients.block(low, high, both[:TERMS])
            turn(both[:TERMS], coefficients.axes, both[TERMS:], out[:, low:high])

    in_slices(work, coefficients.blocks, pool)
    return out


def value_table(photographs: Photographs, curve: Curve) -> Floats | None:
    """Light of every stored value, where it is not the value over white itself."""
    if curve == "srgb":
        return None
    return linear_from_srgb(np.linspace(0, 1, photographs.white + 1)).astype(np.float32)


def worker_count(workers: int | None) -> int:
    """Threads to use: as asked, or as many as processors this process may use."""
    if workers is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if not 1 <= workers <= 256:
        raise SettingsError("workers", f"{workers}; expected 1 to 256")
    return workers


def blocks(count: int, size: int) -> list[Bounds]:
    """Blocks of texels or values, of one size but for the last."""
    return [(low, min(low + size, count)) for low in range(0, count, size)]


def in_slices(work: Callable[[Sequence[Bounds]], None], bounds: Sequence[Bounds], pool: ThreadPoolExecutor) -> None:
    """Do work on all blocks, in slices of neighbouring ones, in all threads of a pool."""
    step = -(-len(bounds) // (SLICES_A_WORKER * pool._max_workers))
    tasks = [pool.submit(work, bounds[first : first + step]) for first in range(0, len(bounds), step)]
    for task in tasks:
        task.result()
