"""Small fans made from formulas, for tests that need one and do not care what it shows."""

from pathlib import Path

import numpy as np

from impostor.fan import Fan
from impostor.normal_code import mip_codes
from impostor.views import Views, frame, layout_bases

GOLDEN = Path(__file__).parent / "golden" / "version_1.fan"  # written once from pattern_fan(), kept for ever


def sound_codes(values):
    """Any bytes as normal codes: what means nothing becomes background."""
    codes = np.asarray(values).astype(np.uint8)
    return np.where(codes > 224, 255, codes).astype(np.uint8)


def pattern_fan(count=3, size=8, levels=4, distance=np.inf):
    """A fan whose texels are a fixed sequence of integers: every machine makes the same one."""

    def texels(*shape, step):
        return (np.arange(np.prod(shape), dtype=np.uint64) * step % 65521).reshape(shape)

    color = texels(count, size, size, 4, step=40503).astype(np.uint8)
    normal = tuple(
        sound_codes(texels(count, max(size >> level, 1), max(size >> level, 1), step=30011 + level))
        for level in range(levels)
    )
    steps = np.arange(count)
    views = Views(
        basis=layout_bases("ring", count, 0.25) if count > 1 else np.eye(3)[None],
        center=np.stack([steps / 7, steps / 3, -steps / 11], axis=-1),
        radius=1 + steps / 9,
        depth_range=np.stack([-1 - steps / 13, 1 + steps / 17], axis=-1),
        distance=distance,
        plane=np.stack([steps / 19, steps / 23, -steps / 29], axis=-1),
    )
    depth = texels(count, size, size, step=50021).astype(np.uint16)
    silhouette = color[..., 3] >= 128
    return Fan(
        "pattern", "ring", views, color, normal, depth, silhouette, {"name": "pattern.obj", "sha256": "0" * 64},
        {"views": count, "elevation": 14.5, "size": size, "up": "y", "perspective": None},
        np.array([[-1, 0, -2.5], [1.5, 3, 0.25]]), 2.75,
    )  # fmt: skip


def bumpy_torus_fan(count=12, size=128, textured=False, seed=0):
    """What a bake of a scanned object looks like to a compressor: fine bumps, dithered codes, dilated edges.

    Every tile shows the same ring seen from the front, turned and displaced by other noise.
    """
    rng = np.random.default_rng(seed)
    x = ((np.arange(size) + 0.5) / size * 2.4 - 1.2)[None, :]
    y = -x.T
    reach = np.hypot(x, y)
    turn = (np.arange(count) / count * 2 * np.pi)[:, None, None]
    bumps = 0.01 * np.sin(25 * (x * np.cos(turn) + y * np.sin(turn))) * np.sin(31 * y + turn)
    height = np.sqrt(np.maximum(0.35**2 - (reach - 0.7) ** 2, 0)) + bumps + rng.normal(0, 2e-4, (count, size, size))
    slope_y, slope_x = np.gradient(height, 2.4 / size, axis=(1, 2))
    normals = np.stack([-slope_x, slope_y, np.ones_like(height)], axis=-1).astype(np.float32)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    coverage = np.broadcast_to(np.abs(reach - 0.7) < 0.35, height.shape).astype(np.float32)
    color = np.full((count, size, size, 4), 200, np.uint8)
    if textured:
        painted = 128 + 90 * np.sin(5 * normals) + rng.normal(0, 1, normals.shape)
        color[..., :3] = np.where(coverage[..., None] > 0, painted, 128)
    color[..., 3] = 255 * coverage
    depth = np.rint(np.where(coverage, 0.1 + height, 0.1) / 0.6 * 4095).astype(np.uint16) * np.uint16(16)
    views = frame(layout_bases("ring", count, 0.25), np.array([[-1.2, -1.2, -0.4], [1.2, 1.2, 0.4]]), size)
    normal = tuple(mip_codes(normals, coverage, size.bit_length()))
    return Fan("torus", "ring", views, color, normal, depth, coverage > 0)


def assert_same_fan(found, expected):
    """Equal to the last bit, types included."""
    assert (found.name, found.layout) == (expected.name, expected.layout)
    assert (found.source, found.settings) == (expected.source, expected.settings)
    np.testing.assert_array_equal(found.bounds, expected.bounds)
    assert found.radius == expected.radius
    assert found.views.distance == expected.views.distance
    for key in ("basis", "center", "radius", "depth_range", "plane"):
        assert np.array_equal(getattr(found.views, key), getattr(expected.views, key)), key
    for key in ("color", "depth", "silhouette"):
        a, b = getattr(found, key), getattr(expected, key)
        assert a.dtype == b.dtype, key
        assert np.array_equal(a, b), key
    assert len(found.normal) == len(expected.normal)
    assert all(np.array_equal(a, b) for a, b in zip(found.normal, expected.normal, strict=True))
