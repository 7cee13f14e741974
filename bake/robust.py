"""Fits that trust shadows and highlights less: what a diffuse surface cannot have done weighs little."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from bake.design import Design
from bake.photographs import Photographs, decoded
from bake.small_products import multiply, solve_symmetric
from impostor.ptm.polynomials import TERMS
from impostor.srgb import linear_from_srgb

Floats = NDArray[np.floating[Any]]

BATCH = 8
BAND_BYTES = 32 * 1024 * 1024  # of all photographs together, read back by one worker at a time
BLOCK_VALUES = 1 << 17  # samples of a block: its floats stay near the processor
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)  # Rec. 709
FIRST_GUESS = (0.4, 0.85)  # quantiles of a texel's samples: darker may be shadow, brighter highlight
STEPS = 6
MAD = np.float32(1.4826)  # median of absolute deviations to standard deviation
NOISE = np.float32(0.003)  # of white: an 8-bit photograph knows no better
# Close to its maximum a polynomial follows a diffuse surface well, far from it not at all.
PEAK = 6
FLOOR = np.float32(0.006)  # what every sample weighs: shadows still darken, where nothing else speaks
# Median deviation from a diffuse surface, relative: below the first it is one, above the second it is none (metal).
DIFFUSE = (np.float32(0.11), np.float32(0.14))
# Share of a texel's variance that the polynomial explains: below the first, shadows fall on it; above the second none
# do, so what is bright on a surface that is not diffuse is its highlight. Measured on metal and on a glossy relief.
UNSHADOWED = (np.float32(0.9), np.float32(0.93))
HIGHLIGHT = 6  # power of value over median at which it loses weight


def robust_coefficients(
    photographs: Photographs,
    design: Design,
    directions: NDArray[np.float64] | None,
    table: Floats | None,
    pool: ThreadPoolExecutor,
    progress: Callable[[int, int], None] | None = None,
) -> Floats:
    """Coefficients of every channel of every texel by weighted least squares, a weight a texel and photograph.

    Parameters
    ----------
    photographs : Photographs
    design : Design
    directions : ndarray of shape (N, 3), float64, optional
        Unit vectors toward the lights; not given where the parameters are no lights.
    table : ndarray of float32, optional
        What stored values stand for; themselves over white if not given.
    pool : ThreadPoolExecutor
    progress : callable, optional

    Returns
    -------
    ndarray of shape (6, C, H * W), float32

    Raises
    ------
    PhotographError

    Notes
    -----
    Each texel's diffuse surface (albedo times normal, three numbers in linear light) is fitted by reweighting, from
    samples that are neither dark nor bright for this texel. A sample far from it is shadow or highlight and loses its
    weight; the others weigh the more the nearer their light is to the normal. Where no diffuse surface fits, samples
    far from the polynomial itself lose weight, and under no shadow (metal) bright ones: around a highlight the
    brightest light lies twice as far off as the normal, and where the nearest lamp stands decides. All samples are
    spooled to a temporary file, in bands of texels, so that memory does not grow with the number of photographs.
    """
    channels, texels, count = photographs.channels, photographs.values // photographs.channels, len(photographs)
    sample_bytes = count * channels * photographs.dtype.itemsize
    band = max(BAND_BYTES // sample_bytes, 1)
    bounds = [(start, min(start + band, texels)) for start in range(0, texels, band)]
    planes = np.empty((TERMS, channels, texels), np.float32)
    steps = count + len(bounds)
    with tempfile.TemporaryFile(prefix="impostor-") as spool:
        done = 0
        for indices, pixels in decoded(photographs, pool, BATCH):
            for index, image in zip(indices.tolist(), pixels, strict=True):
                _write(spool, np.ascontiguousarray(image).reshape(texels, channels), index, bounds, count)
            done += len(indices)
            if progress is not None:
                progress(done, steps)
        del pixels
        lock = threading.Lock()
        weigher = _Weigher(design, directions, photographs.white, table)

        def work(bound: tuple[int, int]) -> None:
            samples = _read(spool, lock, bound, photographs, sample_bytes)
            block = max(BLOCK_VALUES // count, 16)
            for low in range(bound[0], bound[1], block):
                high = min(low + block, bound[1])
                found = weigher.fit(samples[:, low - bound[0] : high - bound[0]])
                planes[:, :, low:high] = found.swapaxes(1, 2)

        for finished, _ in enumerate(pool.map(work, bounds), 1):
            if progress is not None:
                progress(count + finished, steps)
    return planes


class _Weigher:
    """Weights and weighted fits of blocks of texels."""

    def __init__(self, design: Design, directions: NDArray[np.float64] | None, white: int, table: Floats | None):
        self.terms = list(design.terms)
        self.basis = design.matrix[:, self.terms].astype(np.float32)
        self.solver = design.solver[self.terms].astype(np.float32)
        self.directions = None if directions is None else directions.astype(np.float32)
        self.values = np.linspace(0, 1, white + 1, dtype=np.float32) if table is None else table
        self.light = linear_from_srgb(np.linspace(0, 1, white + 1)).astype(np.float32)

    def fit(self, samples: NDArray[Any]) -> Floats:
        """Coefficients (6, n, C) of samples (N, n, C) as they are stored."""
        values = self.values[samples]
        one = values[..., 0] if values.shape[2] == 1 else values @ LUMINANCE
        weights = self._polynomial_weights(one, self.directions is not None)
        if self.directions is not None:
            light = self.light[samples]
            diffuse, share = self._diffuse_weights(light[..., 0] if light.shape[2] == 1 else light @ LUMINANCE)
            weights = share * diffuse + (1 - share) * weights
        result = np.zeros((TERMS, *samples.shape[1:]), np.float32)
        result[self.terms] = _weighted(self.basis, values, weights + FLOOR)
        return result

    def _polynomial_weights(self, values: Floats, of_lights: bool) -> Floats:
        """Weights (N, n) by the distance from each texel's own polynomial (Cauchy); fewer for a metal's highlights."""
        weights, trust = np.ones_like(values), np.float32(1)
        fitted = multiply(self.solver, values)
        for step in range(STEPS):
            if step:
                fitted = _weighted(self.basis, values[..., None], weights)[..., 0]
            residual = values - multiply(self.basis, fitted)
            if of_lights and not step:
                trust = _highlight_weights(values, residual)
            weights = 1 / (1 + (residual / _spread(residual)) ** 2)
        return weights * trust

    def _diffuse_weights(self, light: Floats) -> tuple[Floats, Floats]:
        """Weights (N, n) by the distance from a diffuse surface, and how far (n,) the texel is one, 0..1."""
        toward = self.directions
        assert toward is not None
        dark, bright = np.quantile(light, FIRST_GUESS, axis=0, method="nearest")
        weights = ((light >= dark) & (light <= bright)).astype(np.float32)
        surface = predicted = np.zeros(0, np.float32)
        for _ in range(STEPS):
            surface = _weighted(toward, light[..., None], weights + np.float32(1e-4))[..., 0]
            predicted = multiply(toward, surface)
            residual = light - predicted
            weights = (predicted > 0) / (1 + (residual / _spread(residual)) ** 2)
        albedo = np.maximum(np.linalg.norm(surface, axis=0), np.float32(1e-6))
        facing = np.maximum(predicted / albedo, 0)
        deviation = np.abs(light / albedo - facing) / np.maximum(facing, np.float32(0.1))
        deviation[facing <= 0.1] = np.inf
        middle = np.maximum((facing > 0.1).sum(axis=0) - 1, 0) // 2
        median = np.take_along_axis(np.sort(deviation, axis=0), middle[None], axis=0)[0]
        share = (DIFFUSE[1] - median) / (DIFFUSE[1] - DIFFUSE[0])
        return weights * facing**PEAK, share.clip(0, 1).astype(np.float32)


def _weighted(terms: Floats, values: Floats, weights: Floats) -> Floats:
    """Weighted least squares of many texels: terms (N, T), values (N, n, C) and weights (N, n) to (T, n, C)."""
    size = terms.shape[1]
    rows, columns = np.tril_indices(size)
    gram = np.zeros((size, size, weights.shape[1]))
    gram[rows, columns] = multiply(np.ascontiguousarray((terms[:, rows] * terms[:, columns]).T), weights)
    across = np.ascontiguousarray(terms.T)
    right = np.stack([multiply(across, weights * values[..., c]) for c in range(values.shape[2])], axis=-1)
    return solve_symmetric(gram, right.astype(np.float64)).astype(np.float32)


def _highlight_weights(values: Floats, residual: Floats) -> Floats:
    """Weights (N, n) that bright samples lose where the polynomial leaves small residuals (N, n)."""
    unexplained = residual.var(axis=0) / (values.var(axis=0) + NOISE**2)
    share = ((1 - unexplained - UNSHADOWED[0]) / (UNSHADOWED[1] - UNSHADOWED[0])).clip(0, 1)
    return 1 - share + share / (1 + (values / (np.median(values, axis=0) + NOISE)) ** HIGHLIGHT)


def _spread(residual: Floats) -> Floats:
    """Standard deviation (n,) of residuals (N, n), whatever the worst of them are."""
    middle = len(residual) // 2
    return MAD * np.partition(np.abs(residual), middle, axis=0)[middle] + NOISE


def _write(spool: IO[bytes], texels: NDArray[Any], index: int, bounds: list[tuple[int, int]], count: int) -> None:
    """Put one photograph's part of every band where the band's other photographs are."""
    row = texels.strides[0]
    for start, stop in bounds:
        spool.seek((start * count + (stop - start) * index) * row)
        spool.write(texels[start:stop].data)


def _read(
    spool: IO[bytes], lock: threading.Lock, bound: tuple[int, int], photographs: Photographs, sample_bytes: int
) -> NDArray[Any]:
    """All photographs' samples (N, n, C) of one band."""
    start, stop = bound
    with lock:
        spool.seek(start * sample_bytes)
        data = spool.read((stop - start) * sample_bytes)
    return np.frombuffer(data, photographs.dtype).reshape(len(photographs), stop - start, photographs.channels)
