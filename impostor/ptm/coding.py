"""What other codings of a PTM lose against it: the shift scheme of the 1998 report, and a codebook."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from impostor.ptm.codebook import make_codebook
from impostor.ptm.mipmaps import disc_lights
from impostor.ptm.polynomials import Polynomials, evaluate, picture
from impostor.ptm.shifts import WHITE, shift_quantise, whole_light

HIGHEST_PSNR = 100.0  # dB, of equal pictures: JSON has no infinity


def coding_losses(polynomials: Polynomials, progress: Callable[[int, int], None] | None = None) -> dict[str, float]:
    """How near the pictures of other codings come to a PTM's own.

    Parameters
    ----------
    polynomials : Polynomials
    progress : callable, optional
        Called with steps done and steps in all.

    Returns
    -------
    dict of float
        PSNR in dB of values 0..1 on the PTM's curve, over all light directions: `shift_scheme_db`, in integers
        alone, and `codebook_db`, of 256 entries a table; `codebook_bytes_per_texel`, the tables counted in.

    References
    ----------
    HPL-98-131, section 3. HPL-2004-225, "Light-Dependent Texture Mapping and Beyond".
    """
    shifted, book = shift_quantise(polynomials), make_codebook(polynomials)
    decoded, lights = book.polynomials(), disc_lights()
    squares = np.zeros(2)
    for index, (u, v) in enumerate(lights.tolist()):
        exact = evaluate(polynomials, u, v)
        whole = shifted.evaluate(*map(int, whole_light(u, v))).astype(np.float32) / np.float32(WHITE)
        squares += _square(picture(polynomials, whole), exact), _square(evaluate(decoded, u, v), exact)
        if progress is not None:
            progress(index + 1, len(lights))
    shift_db, book_db = np.minimum(-10 * np.log10(np.maximum(squares / len(lights), 1e-30)), HIGHEST_PSNR).tolist()
    texels = polynomials.size[0] * polynomials.size[1]
    return {
        "shift_scheme_db": round(shift_db, 2),
        "codebook_db": round(book_db, 2),
        "codebook_bytes_per_texel": round(book.bytes / texels, 3),
    }


def _square(values: NDArray[np.float32], exact: NDArray[np.float32]) -> float:
    return float(np.mean(np.square(np.clip(values, 0, 1) - exact), dtype=np.float64))
