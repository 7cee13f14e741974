"""Small PTMs to test with."""

import numpy as np

from impostor.ptm import Polynomials, Ptm
from impostor.ptm.polynomials import RGB_FROM_YCRCB


def random_polynomials(format="LRGB", size=(7, 5), seed=0, curve="srgb", parameters="light"):
    """Polynomials of coefficients from -1 to 1, with nothing in common between texels."""
    random = np.random.default_rng(seed)
    width, height = size
    coefficients = random.uniform(-1, 1, (height, width, 3 if format == "RGB" else 1, 6)).astype(np.float32)
    color = random.random((height, width, 3), np.float32) if format == "LRGB" else None
    chroma = random.random((height, width, 2), np.float32) if format == "LUM" else None
    matrix = RGB_FROM_YCRCB.copy() if format == "LUM" else None
    return Polynomials(coefficients, color, chroma, matrix, curve, parameters)


def random_ptm(format="LRGB", size=(7, 5), seed=0, curve="srgb", parameters="light"):
    """A PTM of all byte values."""
    random = np.random.default_rng(seed)
    width, height = size

    def texels(*shape):
        return random.integers(0, 256, (height, width, *shape), np.uint8)

    return Ptm(
        texels(3 if format == "RGB" else 1, 6),
        np.array([0.5, 1, 2.25, 0.125, 1 / 3, 1e-7]),
        np.array([0, 255, 128, 7, 127, 64]),
        texels(3) if format == "LRGB" else None,
        texels(2) if format == "LUM" else None,
        RGB_FROM_YCRCB.copy() if format == "LUM" else None,
        curve,
        parameters,
    )


def matt_bumps(size=(64, 48), seed=0):
    """Normals (H, W, 3) of a smooth rolling surface and the LRGB PTM of it in white, lit without shadows."""
    random = np.random.default_rng(seed)
    width, height = size
    x, y = np.meshgrid(np.arange(width) / 8, np.arange(height) / 8)
    phases = random.uniform(0, 2 * np.pi, 4)
    slope_x = 0.4 * np.sin(x + phases[0]) * np.cos(y / 2 + phases[1])
    slope_y = 0.4 * np.cos(y + phases[2]) * np.sin(x / 2 + phases[3])
    normals = np.stack([slope_x, slope_y, np.ones_like(x)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    # 1 - |n - l|²/2 over (u, v) only: a polynomial whose maximum is at the normal.
    nu, nv = normals[..., 0], normals[..., 1]
    half = np.full_like(nu, -0.5)
    coefficients = np.stack([half, half, 0 * nu, nu, nv, 1 - (nu * nu + nv * nv) / 2], axis=-1)
    color = 0.2 + 0.8 * random.random((height, width, 3))
    return normals, Polynomials(coefficients[:, :, None].astype(np.float32), color.astype(np.float32))


def assert_same(one, other):
    """All arrays and words of two PTMs are equal."""
    for name in ("coefficients", "scale", "bias", "color", "chroma", "rgb_from_luma"):
        first, second = getattr(one, name), getattr(other, name)
        assert (first is None) == (second is None), name
        if first is not None:
            np.testing.assert_array_equal(first, second, name)
    assert (one.curve, one.parameters) == (other.curve, other.parameters)
