"""How well a PTM reproduces photographs that it was not fitted to."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bake.photographs import Photographs, decoded
from impostor.errors import SettingsError

HIGHEST_PSNR = 100.0  # dB, of equal pictures: JSON has no infinity
BATCH = 4


@dataclass(frozen=True)
class LightScore:
    """The error of one held-out photograph.

    Parameters
    ----------
    photograph : str
        Its file name.
    lu, lv : float
    psnr_db : float
        Over all pixels and channels, of stored values.
    """

    photograph: str
    lu: float
    lv: float
    psnr_db: float


@dataclass(frozen=True)
class HeldOutScore:
    """The error over all held-out photographs.

    Parameters
    ----------
    psnr_db : float
        Of the mean squared error over all of them.
    per_light : list of LightScore
    """

    psnr_db: float
    per_light: list[LightScore]


def score(
    draw: Callable[[float, float], NDArray[np.floating]],
    size: tuple[int, int],
    photographs: Photographs,
    parameters: ArrayLike,
    workers: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> HeldOutScore:
    """Compare pictures with the photographs that were taken under the same lights.

    Parameters
    ----------
    draw : callable
        From (lu, lv) to an ndarray of shape (H, W, 3): the stored values over white, not rounded.
    size : tuple of int
        Width and height of what it draws.
    photographs : Photographs
    parameters : array_like of shape (N, 2), float
    workers : int
        Threads that decode.
    progress : callable, optional

    Returns
    -------
    HeldOutScore

    Raises
    ------
    SettingsError
        The sizes differ.
    PhotographError
    """
    if photographs.size != size:
        raise SettingsError(
            photographs.paths[0], f"is {photographs.size[0]}x{photographs.size[1]}; expected {size[0]}x{size[1]}"
        )
    uv = np.asarray(parameters, np.float64)
    squares, rows = [], []
    with ThreadPoolExecutor(workers) as pool:
        for indices, pixels in decoded(photographs, pool, BATCH):
            for index, image in zip(indices.tolist(), pixels, strict=True):
                lu, lv = uv[index].tolist()
                drawn = np.clip(draw(lu, lv), 0, 1)
                squares.append(float(np.mean((drawn - image / np.float32(photographs.white)) ** 2, dtype=np.float64)))
                rows.append(LightScore(photographs.paths[index].name, lu, lv, _psnr(squares[-1])))
                if progress is not None:
                    progress(len(rows), len(photographs))
    return HeldOutScore(_psnr(float(np.mean(squares))), rows)


def _psnr(square: float) -> float:
    return float(-10 * np.log10(max(square, 10 ** (-HIGHEST_PSNR / 10))))
