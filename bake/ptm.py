"""Fit a PTM to the photographs of a capture set, in one pass over them and in memory that does not grow with them."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bake.color_models import (
    inverse,
    light_spread,
    luma_and_chroma,
    luminance_and_color,
    principal_axes,
    ycrcb,
)
from bake.design import ALL_TERMS, Design, make_design
from bake.photographs import Photographs, decoded
from bake.robust import robust_coefficients
from bake.small_products import multiply
from impostor.errors import SettingsError
from impostor.files.lp_file import CaptureSet
from impostor.ptm.polynomials import TERMS, Curve, Parameters, Polynomials
from impostor.srgb import linear_from_srgb

FORMATS = ("lrgb", "rgb", "lum")
SPACES = ("ycbcr", "principal")
LOWEST = -0.02  # a light this little below the horizon is one on it, measured badly
BATCH = 18  # photographs between two visits to the accumulators, which weigh as much as 24 of them
BLOCK = 19200  # values of a photograph at a time: fewer lose time between calls, more fall out of the cache
SLICES_A_WORKER = 4  # so that workers end together


def fit_ptm(
    photographs: Photographs,
    parameters: ArrayLike,
    *,
    format: str = "lrgb",
    curve: Curve = "srgb",
    meaning: Parameters = "light",
    terms: tuple[int, ...] = ALL_TERMS,
    space: str = "ycbcr",
    robust: bool = False,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Polynomials:
    """Fit a polynomial to every texel by linear least squares.

    Parameters
    ----------
    photographs : Photographs
        N of them.
    parameters : array_like of shape (N, 2), float
        (u, v) of each: the unit light direction's projection on tangent and binormal; or see `meaning`.
    format : {"lrgb", "rgb", "lum"}
        One luminance polynomial times the colour that suits it best, one polynomial a channel, or one luma
        polynomial beside constant chroma. Gray photographs give three equal channels.
    curve : {"srgb", "linear"}
        Fit the stored values, as both HP reports do, or light: photographs are then taken as sRGB.
    meaning : {"light", "view", "series"}
        What the parameters are, recorded in the result.
    terms : tuple of int
        Which of u², v², uv, u, v, 1 to fit; the rest is 0.
    space : {"ycbcr", "principal"}
        Of "lum": JPEG's YCbCr, or the axes along which these photographs vary most and least.
    robust : bool
        Weigh shadows and highlights less; see `robust_coefficients`. Takes many times as long.
    workers : int, optional
        Threads; as many as processors if not given.
    progress : callable, optional
        Called with photographs done and photographs in all.

    Returns
    -------
    Polynomials

    Raises
    ------
    SettingsError
        As `make_design`, or an unknown choice.
    PhotographError
        A photograph that cannot be decoded.

    Notes
    -----
    The pseudo-inverse of the lights' matrix is known before the first pixel is, so each photograph adds its share to
    the coefficients and is forgotten.

    References
    ----------
    HPL-98-131, section 3. HPL-2004-225, "PTM Representation".
    """
    check_choices(format, curve, space)
    design = make_design(parameters, terms)
    if len(design.matrix) != len(photographs):
        raise SettingsError("lights", f"{len(design.matrix)} for {len(photographs)} photographs; expected one each")
    with ThreadPoolExecutor(worker_count(workers)) as pool:
        if robust:
            lights = unit_lights(design.parameters) if meaning == "light" else None
            table = value_table(photographs, curve)
            planes = robust_coefficients(photographs, design, lights, table, pool, progress)
        else:
            planes = accumulate(photographs, design, curve, pool, progress)
        return assemble(planes, photographs.size, design, format, space, curve, meaning, pool)


def light_parameters(capture: CaptureSet) -> NDArray[np.float64]:
    """(lu, lv) of a capture set's lights: (N, 2), float64.

    Raises
    ------
    SettingsError
        A light stands behind the object, where the same (lu, lv) means another light.
    """
    behind = np.flatnonzero(capture.directions[:, 2] < LOWEST)
    if len(behind):
        name = capture.photographs[behind[0]].name if capture.photographs else f"light {behind[0] + 1}"
        raise SettingsError(name, f"light's z is {capture.directions[behind[0], 2]:.3g}; expected above 0, in front")
    return capture.directions[:, :2]


def unit_lights(parameters: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors (N, 3) toward the lights of (lu, lv)."""
    height = np.sqrt(np.clip(1 - (parameters**2).sum(axis=1), 0, 1))
    return np.column_stack([parameters, height]).astype(np.float64)


def check_choices(format: str, curve: str, space: str) -> None:
    """Refuse what is not one of the known formats, curves and colour spaces."""
    for name, value, known in (
        ("format", format, FORMATS),
        ("curve", curve, ("srgb", "linear")),
        ("space", space, SPACES),
    ):
        if value not in known:
            raise SettingsError(name, f"{value!r}; expected {' or '.join(known)}")


def worker_count(workers: int | None) -> int:
    """Threads to use: as asked, or as many as processors this process may use."""
    if workers is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if not 1 <= workers <= 256:
        raise SettingsError("workers", f"{workers}; expected 1 to 256")
    return workers


def accumulate(
    photographs: Photographs,
    design: Design,
    curve: Curve,
    pool: ThreadPoolExecutor,
    progress: Callable[[int, int], None] | None = None,
) -> NDArray[np.float32]:
    """Coefficients of every channel of every texel.

    Parameters
    ----------
    photographs : Photographs
    design : Design
    curve : {"srgb", "linear"}
    pool : ThreadPoolExecutor
    progress : callable, optional

    Returns
    -------
    ndarray of shape (6, H * W, C), float32
        Six planes, each a picture.
    """
    table = value_table(photographs, curve)
    scale = 1 if table is not None else 1 / photographs.white
    solver = (design.solver * scale).astype(np.float32)
    planes = np.empty((TERMS, photographs.values), np.float32)
    bounds = slices(photographs.values, SLICES_A_WORKER * pool._max_workers)
    done = 0
    for indices, pixels in decoded(photographs, pool, BATCH):
        values = pixels.reshape(len(pixels), -1)
        weights = np.ascontiguousarray(solver[:, indices])
        tasks = [pool.submit(_add, planes, values, weights, table, done > 0, *bound) for bound in bounds]
        for task in tasks:
            task.result()
        done += len(indices)
        if progress is not None:
            progress(done, len(photographs))
    return planes.reshape(TERMS, -1, photographs.channels)


def value_table(photographs: Photographs, curve: Curve) -> NDArray[np.float32] | None:
    """Light of every stored value, where it is not the value over white itself."""
    if curve == "srgb":
        return None
    return linear_from_srgb(np.linspace(0, 1, photographs.white + 1)).astype(np.float32)


def slices(length: int, count: int) -> list[tuple[int, int]]:
    """Bounds that cut a length into about equal parts, each a whole number of blocks but the last."""
    step = -(-length // (count * BLOCK)) * BLOCK
    return [(start, min(start + step, length)) for start in range(0, length, step)]


def _add(
    planes: NDArray[np.float32],
    photographs: NDArray[Any],
    weights: NDArray[np.float32],
    table: NDArray[np.float32] | None,
    begun: bool,
    start: int,
    stop: int,
) -> None:
    """Add a batch's share to one slice of the coefficients; the first batch's share is what they begin with."""
    values = np.empty((len(photographs), BLOCK), np.float32)
    share = np.empty((TERMS, BLOCK), np.float32)
    for low in range(start, stop, BLOCK):
        high = min(low + BLOCK, stop)
        width = high - low
        if table is None:
            np.copyto(values[:, :width], photographs[:, low:high])
        else:
            np.take(table, photographs[:, low:high], out=values[:, :width], mode="clip")
        multiply(weights, values[:, :width], share[:, :width])
        if begun:
            planes[:, low:high] += share[:, :width]
        else:
            planes[:, low:high] = share[:, :width]


def assemble(
    planes: NDArray[np.float32],
    size: tuple[int, int],
    design: Design,
    format: str,
    space: str,
    curve: Curve,
    meaning: Parameters,
    pool: ThreadPoolExecutor,
) -> Polynomials:
    """A PTM of the wanted format from the coefficients of every channel.

    Parameters
    ----------
    planes : ndarray of shape (6, H * W, C), float32
    size : tuple of int
        Width and height.
    design : Design
    format, space, curve, meaning : str
        As `fit_ptm`.
    pool : ThreadPoolExecutor

    Returns
    -------
    Polynomials
    """
    width, height = size
    make = partial(Polynomials, curve=curve, parameters=meaning)
    if planes.shape[2] == 1 and format == "lrgb":
        white = np.broadcast_to(np.ones(3, np.float32), (height, width, 3))
        return make(_coefficients(planes, size), color=white)
    if planes.shape[2] == 1:
        planes = np.broadcast_to(planes, (*planes.shape[:2], 3))
    if format == "rgb":
        return make(_coefficients(planes, size))
    parts = slices(planes.shape[1], -(-planes.shape[1] // BLOCK))
    one = np.empty(planes.shape[:2], np.float32)
    if format == "lrgb":
        color = np.empty((planes.shape[1], 3), np.float32)

        def split(start: int, stop: int) -> None:
            one[:, start:stop], color[start:stop] = luminance_and_color(planes[:, start:stop], design)

        list(pool.map(lambda part: split(*part), parts))
        return make(_coefficients(one[..., None], size), color=color.reshape(height, width, 3))
    chroma = np.empty((planes.shape[1], 2), np.float32)
    axes = ycrcb() if space == "ycbcr" else principal_axes(_total_spread(planes, design, parts, pool))

    def turn(start: int, stop: int) -> None:
        one[:, start:stop], chroma[start:stop] = luma_and_chroma(planes[:, start:stop], design, axes)

    list(pool.map(lambda part: turn(*part), parts))
    return make(
        _coefficients(one[..., None], size),
        chroma=chroma.reshape(height, width, 2),
        rgb_from_luma=inverse(axes),
    )


def _total_spread(
    planes: NDArray[np.float32], design: Design, parts: list[tuple[int, int]], pool: ThreadPoolExecutor
) -> NDArray[np.float64]:
    return np.sum(list(pool.map(lambda part: light_spread(planes[:, part[0] : part[1]], design), parts)), axis=0)


def _coefficients(planes: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
    """The planes (6, H * W, C) as `Polynomials` has them, without a copy."""
    return np.moveaxis(planes.reshape(TERMS, size[1], size[0], -1), 0, -1)
