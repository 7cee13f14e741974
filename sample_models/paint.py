"""Painting textures in NumPy: noise that tiles, blending, leaves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import distance_transform_edt


def rgb(color: str) -> np.ndarray:
    """The (3,) sRGB values 0..1 of a colour written as "#rrggbb"."""
    return np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)]) / 255


def noise(shape: tuple[int, ...], seed: int, slope: float = 1.6, stretch: tuple[float, float] = (1, 1)) -> np.ndarray:
    """Cloudy noise that tiles, mean 0 and standard deviation 1.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns.
    seed : int
    slope : float
        Amplitude falls with frequency to this power: larger is smoother.
    stretch : (float, float)
        Grain length along rows and columns.
    """
    white = np.random.default_rng(seed).standard_normal(shape)
    fy = np.fft.fftfreq(shape[0])[:, None] * shape[0] * stretch[0]
    fx = np.fft.rfftfreq(shape[1])[None, :] * shape[1] * stretch[1]
    frequency = np.hypot(fy, fx)
    frequency[0, 0] = np.inf
    field = np.fft.irfft2(np.fft.rfft2(white) * frequency**-slope, s=shape)
    return (field - field.mean()) / field.std()


def mix(a: np.ndarray, b: np.ndarray, amount: np.ndarray | float) -> np.ndarray:
    """Colour `a` where amount is 0, `b` where it is 1; an (H, W) amount blends images."""
    amount = np.clip(amount, 0.0, 1.0)
    if isinstance(amount, np.ndarray) and amount.ndim == 2:
        amount = amount[..., None]
    return a * (1 - amount) + b * amount


def ramp(value: np.ndarray, colors: Sequence[str]) -> np.ndarray:
    """A value 0..1 looked up in evenly spaced colours."""
    table = np.array([rgb(color) for color in colors])
    at = np.linspace(0, 1, len(table))
    return np.stack([np.interp(value, at, table[:, k]) for k in range(3)], axis=-1)


def to_bytes(image: np.ndarray) -> np.ndarray:
    """Floats 0..1 as uint8."""
    return np.round(np.clip(image, 0, 1) * 255).astype(np.uint8)


def shrink(image: np.ndarray, factor: int) -> np.ndarray:
    """The mean of blocks of factor x factor pixels."""
    h, w, c = image.shape
    return image.reshape(h // factor, factor, w // factor, factor, c).mean(axis=(1, 3))


def blade(
    canvas: np.ndarray, base: np.ndarray, tip: np.ndarray, width: float, color: np.ndarray, veins: float = 0.0
) -> None:
    """Paint one leaf or needle over a canvas.

    Parameters
    ----------
    canvas : ndarray, (H, W, 4) float64
        Changed in place; colour is not multiplied by alpha.
    base, tip : ndarray, (2,) float
        Ends in pixels, x right and y down.
    width : float
        Greatest width in pixels.
    color : ndarray, (3,) float
    veins : float
        Strength of midrib, side veins and the lit half; 0 for a plain needle.
    """
    h, w = canvas.shape[:2]
    low = np.floor(np.minimum(base, tip) - width).astype(int)
    high = np.ceil(np.maximum(base, tip) + width).astype(int)
    x0, y0 = np.clip(low, 0, (w, h))
    x1, y1 = np.clip(high, 0, (w, h))
    if x1 <= x0 or y1 <= y0:
        return
    y, x = np.mgrid[y0:y1, x0:x1] + 0.5
    axis = tip - base
    length = np.hypot(*axis)
    along = ((x - base[0]) * axis[0] + (y - base[1]) * axis[1]) / length**2
    across = (-(x - base[0]) * axis[1] + (y - base[1]) * axis[0]) / length
    inside = np.clip(along, 0, 1)
    half = 0.5 * width * np.sin(np.pi * inside**0.75) ** 0.8 if veins else 0.5 * width * (1 - inside**3)
    cover = np.clip(half - np.abs(across) + 0.5, 0, 1) * ((along >= 0) & (along <= 1))
    shade = np.ones_like(along)
    if veins:
        side = across / np.maximum(half, 1e-6)
        rib = np.exp(-((across / (0.035 * width + 0.6)) ** 2))
        vein = np.cos(2 * np.pi * (along * 9 - np.abs(side) * 1.3)) ** 8
        shade = 1 + veins * (0.10 * np.sign(side) + 0.22 * rib + 0.06 * vein - 0.16 * side**2 - 0.10 * (1 - inside))
    part = canvas[y0:y1, x0:x1]
    part[..., :3] = mix(part[..., :3], np.clip(color * shade[..., None], 0, 1), cover)
    part[..., 3] = np.maximum(part[..., 3], cover)


def bleed(image: np.ndarray) -> np.ndarray:
    """Spread the covered colours into the transparent texels, so that filtering brings in no dark rim."""
    nearest = np.asarray(distance_transform_edt(image[..., 3] < 0.5, return_distances=False, return_indices=True))
    out = image.copy()
    out[..., :3] = image[..., :3][tuple(nearest)]
    empty = image[..., 3] <= 0
    mean = image[image[..., 3] > 0.5][:, :3].mean(axis=0)
    far = np.asarray(distance_transform_edt(empty)) > 12
    out[far, :3] = mean
    return out


def bark(size: int, seed: int, colors: Sequence[str], moss: str | None = None) -> np.ndarray:
    """Fissured bark, (size, size, 3), that tiles; the trunk runs up the image."""
    plates = np.abs(noise((size, size), seed, 1.5, (1.0, 0.22)))
    fine = noise((size, size), seed + 1, 1.0, (1.0, 0.4))
    image = ramp(np.clip(plates * 0.62 + 0.10 * fine + 0.08, 0, 1), colors)
    if moss is not None:
        image = mix(image, rgb(moss), 0.55 * np.clip(noise((size, size), seed + 2, 1.8) - 0.6, 0, 1))
    return image
