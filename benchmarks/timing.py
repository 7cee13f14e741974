"""Clocks: medians of runs that alternate with each other."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

REPEATS = 9
SHORTEST_SAMPLE = 0.02  # seconds; what is faster is called several times a sample


@dataclass(frozen=True)
class Times:
    """Seconds (repeats, jobs) of jobs that ran in turns."""

    samples: NDArray[np.float64]

    def median(self, job: int) -> float:
        """Seconds of one job."""
        return float(np.median(self.samples[:, job]))

    def ratio(self, job: int, base: int) -> float:
        """How many times longer one job takes than another: the median over neighbouring runs."""
        return float(np.median(self.samples[:, job] / self.samples[:, base]))

    def net_ratio(self, job: int, base: int, empty: int) -> float:
        """As `ratio`, with what both jobs share taken off them."""
        shared = np.median(self.samples[:, empty])
        return float(np.median((self.samples[:, job] - shared) / (self.samples[:, base] - shared)))


def alternate(
    *jobs: Callable[[], object], ctx: moderngl.Context | None = None, repeats: int = REPEATS, warm_up: int = 2
) -> Times:
    """Run jobs in turns, A B C A B C.

    Parameters
    ----------
    *jobs : callable
    ctx : moderngl.Context, optional
        The GPU is waited for after every call.
    repeats : int
    warm_up : int
        Calls of each job before the clock starts.
    """
    finish = ctx.finish if ctx is not None else lambda: None
    calls = [_calls_a_sample(job, finish, warm_up) for job in jobs]
    samples = np.zeros((repeats, len(jobs)))
    for row in samples:
        for index, (job, number) in enumerate(zip(jobs, calls, strict=True)):
            start = time.perf_counter()
            for _ in range(number):
                job()
                finish()
            row[index] = (time.perf_counter() - start) / number
    return Times(samples)


def _calls_a_sample(job: Callable[[], object], finish: Callable[[], object], warm_up: int) -> int:
    fastest = np.inf
    for _ in range(max(warm_up, 1)):
        start = time.perf_counter()
        job()
        finish()
        fastest = min(fastest, time.perf_counter() - start)
    return int(np.clip(SHORTEST_SAMPLE / max(fastest, 1e-7), 1, 1000))
