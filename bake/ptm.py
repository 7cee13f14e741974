"""Fit a PTM to the photographs of a capture set."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bake.color_models import (
    inverse,
    light_root,
    light_spread,
    luma_and_chroma,
    luminance_and_color,
    principal_axes,
    three_polynomials,
    ycrcb,
)
from bake.design import ALL_TERMS, make_design
from bake.half_chroma import HalfChroma, HalfChromaCoefficients
from bake.one_pass import Coefficients, PlanarCoefficients, accumulate, turned, value_table, worker_count
from bake.photographs import Photographs
from bake.robust import robust_coefficients
from impostor.errors import SettingsError
from impostor.files.lp_file import CaptureSet
from impostor.ptm.polynomials import TERMS, Curve, Parameters, Polynomials, light_direction

FORMATS = ("lrgb", "rgb", "lum")
SPACES = ("ycbcr", "principal")
LOWEST = -0.02  # a light this little below the horizon is one on it, measured badly


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

    References
    ----------
    HPL-98-131, section 3. HPL-2004-225, "PTM Representation".
    """
    check_choices(format, curve, space)
    design = make_design(parameters, terms)
    if len(design.matrix) != len(photographs):
        raise SettingsError("lights", f"{len(design.matrix)} for {len(photographs)} photographs; expected one each")
    with ThreadPoolExecutor(worker_count(workers)) as pool:
        # The luminance and colour of coefficients are found where all lights count alike.
        root = light_root(design) if format == "lrgb" and photographs.channels == 3 else None
        if robust:
            lights = light_direction(*design.parameters.T) if meaning == "light" else None
            table = value_table(photographs, curve)
            planes = robust_coefficients(photographs, design, lights, table, pool, progress)
            found = PlanarCoefficients(planes, None if root is None else root.astype(np.float32))
        else:
            found = _least_squares(
                photographs, design.solver if root is None else root @ design.solver, curve, pool, progress
            )
        make = partial(Polynomials, curve=curve, parameters=meaning)
        size = width, height = photographs.size

        def rows(count: int) -> NDArray[np.float32]:
            return np.empty((count, width * height), np.float32)

        if format == "lrgb" and photographs.channels == 1:
            assert isinstance(found, PlanarCoefficients)
            white = np.broadcast_to(np.float32(1), (height, width, 3))
            return make(_pictures(found.planes, size), color=white)
        if root is not None:
            back = np.linalg.pinv(root).astype(np.float32)
            done = turned(found, partial(luminance_and_color, back=back), rows(9), pool)
            return make(_pictures(done[:6, None], size), color=_pictures(done[6:], size))
        if format == "lum":
            axes = ycrcb() if space == "ycbcr" else principal_axes(light_spread(found, design, pool))
            done = turned(found, partial(luma_and_chroma, design=design, luma_from_rgb=axes), rows(8), pool)
            chroma = _pictures(done[6:], size)
            return make(_pictures(done[:6, None], size), chroma=chroma, rgb_from_luma=inverse(axes))
        if isinstance(found, PlanarCoefficients):
            planes = np.broadcast_to(found.planes, (TERMS, 3, width * height))
        else:
            planes = turned(found, three_polynomials, rows(18), pool).reshape(TERMS, 3, -1)
        return make(_pictures(planes, size))


def light_parameters(capture: CaptureSet) -> NDArray[np.float64]:
    """(lu, lv) of a capture set's lights: (N, 2), float64.

    Raises
    ------
    SettingsError
        A light stands behind the object, where the same (lu, lv) means another light.
    """
    behind = np.flatnonzero(capture.directions[:, 2] < LOWEST)
    if len(behind):
        name = capture.photographs[behind[0]] if capture.photographs else f"light {behind[0] + 1}"
        raise SettingsError(name, f"light's z is {capture.directions[behind[0], 2]:.3g}; expected above 0, in front")
    return capture.directions[:, :2]


def check_choices(format: str, curve: str, space: str) -> None:
    """Refuse what is not one of the known formats, curves and colour spaces."""
    for name, value, known in (
        ("format", format, FORMATS),
        ("curve", curve, ("srgb", "linear")),
        ("space", space, SPACES),
    ):
        if value not in known:
            raise SettingsError(name, f"{value!r}; expected {' or '.join(known)}")


def _least_squares(
    photographs: Photographs,
    weights: NDArray[np.float64],
    curve: Curve,
    pool: ThreadPoolExecutor,
    progress: Callable[[int, int], None] | None,
) -> Coefficients:
    """Products of weights (6, N) and all samples; of half the samples where photographs are stored so."""
    table = value_table(photographs, curve)
    scale = 1 if table is not None else 1 / photographs.white
    solver = (weights * scale).astype(np.float32)
    if photographs.half_chroma and table is None:
        planes = accumulate(HalfChroma(photographs), solver, pool, None, progress)
        return HalfChromaCoefficients(planes, photographs, solver)
    planes = accumulate(photographs, solver, pool, table, progress)
    return PlanarCoefficients(planes.reshape(TERMS, photographs.channels, -1))


def _pictures(planes: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
    """Planes (..., C, H * W) as pictures (H, W, C, ...), without a copy."""
    planes = planes.reshape(*planes.shape[:-1], size[1], size[0])
    return planes.transpose(planes.ndim - 2, planes.ndim - 1, *reversed(range(planes.ndim - 2)))
