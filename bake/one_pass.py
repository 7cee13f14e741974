"""Coefficients of every texel in one pass over the photographs, in memory that does not grow with their number."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake.design import Design
from bake.photographs import Photographs, decoded
from bake.small_products import multiply
from impostor.errors import SettingsError
from impostor.ptm.polynomials import TERMS, Curve
from impostor.srgb import linear_from_srgb

# From coefficients (6, C, n) of a few texels, and scratch memory (9, C, n), to what is wanted of them: (6, C, n).
Turn = Callable[[NDArray[np.float32], NDArray[np.float32]], NDArray[np.float32]]
SCRATCH = 9

BATCH = 17  # photographs between two visits to the accumulators, which weigh as much as 24 of them
BLOCK = 6400  # texels of a batch at a time: fewer lose time between calls, more fall out of the cache
SLICES_A_WORKER = 4  # so that workers end together


def accumulate(
    photographs: Photographs,
    design: Design,
    curve: Curve,
    pool: ThreadPoolExecutor,
    progress: Callable[[int, int], None] | None = None,
    turn: Turn | None = None,
) -> NDArray[np.float32]:
    """Coefficients of every channel of every texel by linear least squares.

    Parameters
    ----------
    photographs : Photographs
    design : Design
    curve : {"srgb", "linear"}
    pool : ThreadPoolExecutor
    progress : callable, optional
        Called with photographs decoded and photographs in all.
    turn : callable, optional
        Takes the coefficients (6, C, n), float32, of a block of texels while they are still in the cache, and scratch
        memory (9, C, n), float32; gives what is to be returned in their place. Called in worker threads.

    Returns
    -------
    ndarray of shape (6, C, H * W), float32

    Raises
    ------
    PhotographError

    Notes
    -----
    The pseudo-inverse of the lights' matrix is known before the first pixel is, so each photograph adds its share to
    the coefficients and is forgotten. Batches and blocks do not depend on the threads, nor then does any rounding.
    """
    table = value_table(photographs, curve)
    scale = 1 if table is not None else 1 / photographs.white
    solver = (design.solver * scale).astype(np.float32)
    texels = photographs.size[0] * photographs.size[1]
    planes = np.empty((TERMS, photographs.channels, texels), np.float32)
    done = 0
    for indices, pixels in decoded(photographs, pool, BATCH, progress):
        values = np.moveaxis(pixels, -1, 1).reshape(len(pixels), photographs.channels, texels)
        weights = np.ascontiguousarray(solver[:, indices])
        last = done + len(indices) == len(photographs)
        share = _Share(planes, values, weights, table, done > 0, turn if last else None)
        _in_slices(share.add, texels, pool)
        done += len(indices)
    return planes


def turn_all(planes: NDArray[np.float32], turn: Turn, pool: ThreadPoolExecutor) -> None:
    """Put in the place of coefficients (6, C, N), block by block, what is wanted of them."""

    def work(start: int, stop: int) -> None:
        channels = planes.shape[1]
        memory = np.empty((TERMS + SCRATCH) * channels * min(BLOCK, stop - start), np.float32)
        for low, high in blocks(start, stop):
            both = memory[: (TERMS + SCRATCH) * channels * (high - low)].reshape(-1, channels, high - low)
            block, scratch = both[:TERMS], both[TERMS:]
            np.copyto(block, planes[:, :, low:high])
            planes[:, :, low:high] = turn(block, scratch)

    _in_slices(work, planes.shape[2], pool)


def blocks(start: int, stop: int) -> list[tuple[int, int]]:
    """The blocks of texels from one up to another."""
    return [(low, min(low + BLOCK, stop)) for low in range(start, stop, BLOCK)]


def value_table(photographs: Photographs, curve: Curve) -> NDArray[np.float32] | None:
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


def _in_slices(work: Callable[[int, int], None], texels: int, pool: ThreadPoolExecutor) -> None:
    """Do work on all texels, in slices of whole blocks, in all threads of a pool."""
    count = SLICES_A_WORKER * pool._max_workers
    step = -(-texels // (count * BLOCK)) * BLOCK
    tasks = [pool.submit(work, start, min(start + step, texels)) for start in range(0, texels, step)]
    for task in tasks:
        task.result()


class _Share:
    """What one batch (K, C, N) adds to the coefficients (6, C, N); the first one's share is what they begin with."""

    def __init__(
        self,
        planes: NDArray[np.float32],
        batch: NDArray[Any],
        weights: NDArray[np.float32],
        table: NDArray[np.float32] | None,
        begun: bool,
        turn: Turn | None,
    ):
        self.planes, self.batch, self.weights, self.table = planes, batch, weights, table
        self.begun, self.turn = begun, turn

    def add(self, start: int, stop: int) -> None:
        """Add it for a slice of texels."""
        count, channels, _ = self.batch.shape
        most = min(BLOCK, stop - start) * channels
        # The photographs' values are spent when the coefficients are turned: their memory is scratch then.
        value_memory = np.empty(max(count, SCRATCH) * most, np.float32)
        share_memory = np.empty(TERMS * most, np.float32)
        for low, high in blocks(start, stop):
            length = channels * (high - low)
            values = value_memory[: count * length].reshape(count, channels, high - low)
            share = share_memory[: TERMS * length].reshape(TERMS, channels, high - low)
            if self.table is None:
                np.copyto(values, self.batch[:, :, low:high])
            else:
                np.take(self.table, self.batch[:, :, low:high], out=values, mode="clip")
            multiply(self.weights, values.reshape(count, length), share.reshape(TERMS, length))
            planes = self.planes[:, :, low:high]
            if self.begun:
                np.add(planes, share, out=planes if self.turn is None else share)
            if self.turn is not None:
                planes[:] = self.turn(share, value_memory[: SCRATCH * length].reshape(SCRATCH, channels, high - low))
            elif not self.begun:
                planes[:] = share
