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
    ycrcb,
)
from bake.design import ALL_TERMS, Design, make_design
from bake.one_pass import Turn, accumulate, blocks, turn_all, value_table, worker_count
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

        def fit(turn: Turn | None = None) -> NDArray[np.float32]:
            if not robust:
                return accumulate(photographs, design, curve, pool, progress, turn)
            lights = light_direction(*design.parameters.T) if meaning == "light" else None
            planes = robust_coefficients(photographs, design, lights, value_table(photographs, curve), pool, progress)
            if turn is not None:
                turn_all(planes, turn, pool)
            return planes

        make = partial(Polynomials, curve=curve, parameters=meaning)
        size, gray = photographs.size, photographs.channels == 1
        if format == "lrgb" and gray:
            white = np.broadcast_to(np.float32(1), (size[1], size[0], 3))
            return make(_pictures(fit(), size), color=white)
        if format == "lrgb":
            planes = fit(partial(luminance_and_color, root=light_root(design)))
            return make(_pictures(planes[:, :1], size), color=_pictures(planes[:3, 1], size))
        if format == "lum":
            planes, axes = _luma(fit, design, space, gray, pool)
            chroma = _pictures(planes[:2, 1], size)
            return make(_pictures(planes[:, :1], size), chroma=chroma, rgb_from_luma=inverse(axes))
        planes = fit()
        return make(_pictures(np.broadcast_to(planes, (TERMS, 3, planes.shape[2])), size))


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


def check_choices(format: str, curve: str, space: str) -> None:
    """Refuse what is not one of the known formats, curves and colour spaces."""
    for name, value, known in (
        ("format", format, FORMATS),
        ("curve", curve, ("srgb", "linear")),
        ("space", space, SPACES),
    ):
        if value not in known:
            raise SettingsError(name, f"{value!r}; expected {' or '.join(known)}")


def _luma(
    fit: Callable[[Turn | None], NDArray[np.float32]], design: Design, space: str, gray: bool, pool: ThreadPoolExecutor
) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """As `luma_and_chroma`, of all texels; and the colour space that was taken, (3, 4)."""
    if space == "ycbcr" and not gray:
        return fit(partial(luma_and_chroma, design=design, luma_from_rgb=ycrcb())), ycrcb()
    planes = fit(None)
    if gray:
        planes = np.repeat(planes, 3, axis=1)
    ends = blocks(0, planes.shape[2])
    spreads = pool.map(lambda ends: light_spread(planes[:, :, slice(*ends)], design), ends)
    axes = ycrcb() if space == "ycbcr" else principal_axes(np.sum(list(spreads), axis=0))
    turn_all(planes, partial(luma_and_chroma, design=design, luma_from_rgb=axes), pool)
    return planes, axes


def _pictures(planes: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
    """Planes (..., C, H * W) as pictures (H, W, C, ...), without a copy."""
    planes = planes.reshape(*planes.shape[:-1], size[1], size[0])
    return planes.transpose(planes.ndim - 2, planes.ndim - 1, *reversed(range(planes.ndim - 2)))
