"""Pictures for people: PNG files, whole or not at all."""

from __future__ import annotations

from os import PathLike

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from impostor.files.output import atomic_output


def save_png(path: str | PathLike[str], pixels: NDArray[np.uint8], *, force: bool = False) -> None:
    """Write (H, W), (H, W, 3) or (H, W, 4) uint8 pixels as a PNG, all of it or nothing.

    Raises
    ------
    OutputError
        The file exists and `force` is not set, or it cannot be written.
    """
    with atomic_output(path, force=force) as temporary:
        Image.fromarray(np.ascontiguousarray(pixels)).save(temporary, format="PNG")
