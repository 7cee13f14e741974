"""Capture sets that the tests photograph themselves: pictures whose polynomials are known."""

import numpy as np
from PIL import Image

from bake.dome import fibonacci_dome
from impostor.files.lp_file import CaptureSet, write_lp
from impostor.ptm.polynomials import basis


def write_photographs(folder, pictures, suffix=".png", name="image"):
    """Write arrays (H, W[, 3]), uint8 or uint16, as pictures; the paths."""
    paths = [folder / f"{name}{number:02d}{suffix}" for number in range(len(pictures))]
    for path, picture in zip(paths, pictures, strict=True):
        Image.fromarray(picture).save(path)
    return paths


def write_capture_set(folder, pictures, lights, suffix=".png"):
    """Write pictures and the `.lp` file that names them; its path."""
    paths = write_photographs(folder, pictures, suffix)
    lp = folder / "set.lp"
    write_lp(CaptureSet(tuple(paths), np.asarray(lights, float)), lp)
    return lp


def known_polynomials(height=5, width=7, channels=3, seed=0):
    """Coefficients (H, W, C, 6) of pictures that stay between black and white."""
    scale = np.array([0.05, 0.05, 0.05, 0.1, 0.1, 0.1])
    random = np.random.default_rng(seed).uniform(-1, 1, (height, width, channels, 6))
    return random * scale + [0, 0, 0, 0, 0, 0.5]


def photographed(coefficients, parameters, white=255):
    """What a camera would store of polynomials (H, W, C, 6) at parameters (N, 2): (N, H, W, C) of integers."""
    values = np.einsum("hwct,nt->nhwc", coefficients, basis(*np.asarray(parameters).T))
    dtype = np.uint8 if white == 255 else np.uint16
    return np.rint(values * white).clip(0, white).astype(dtype)


LIGHTS = fibonacci_dome(30, np.radians(15))
