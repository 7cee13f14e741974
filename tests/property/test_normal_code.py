"""What holds for every normal and every silhouette."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from impostor.normal_code import BACKGROUND, BYTE_TO_NORMAL, decode, dither, encode

CELL = 1 / 8.5


@st.composite
def facing_normals(draw, radius=1.0):
    """A unit normal with z >= 0 whose (x, y) lies within the radius."""
    distance, angle = draw(st.floats(0, radius)), draw(st.floats(0, 2 * np.pi))
    x, y = distance * np.cos(angle), distance * np.sin(angle)
    return np.array([x, y, np.sqrt(max(0.0, 1 - x * x - y * y))])


seeds = st.integers(0, 2**32 - 1)
codes = st.integers(0, 224).map(np.uint8)


def random_normals(seed, shape):
    normals = np.random.default_rng(seed).normal(size=(*shape, 3))
    normals[..., 2] = np.abs(normals[..., 2])
    return (normals / np.linalg.norm(normals, axis=-1, keepdims=True)).astype(np.float32)


@given(facing_normals())
def test_a_code_is_the_nearest_and_within_the_stated_bound(normal):
    distance = np.hypot(*(BYTE_TO_NORMAL[:225, :2].astype(float) - normal[:2]).T)
    chosen = distance[encode(normal)]
    assert chosen <= distance.min() + 1e-6
    assert chosen <= 0.97 * CELL


@given(facing_normals(radius=0.8))
def test_away_from_the_rim_a_code_is_within_half_a_cell_each_way_and_eight_degrees(normal):
    decoded = decode(encode(normal))
    assert np.abs(decoded - normal)[:2].max() <= 0.5 * CELL + 1e-6
    assert decoded @ normal >= np.cos(np.radians(8))


@given(codes, st.sampled_from([np.float16, np.float32, np.float64]))
def test_encoding_a_decoded_code_gives_it_back(code, dtype):
    assert encode(decode(code).astype(dtype)) == code


@given(codes, arrays(bool, (2, 7, 9)))
def test_a_constant_normal_of_the_table_stays_constant(code, mask):
    normals = np.broadcast_to(decode(code), (2, 7, 9, 3))
    np.testing.assert_array_equal(dither(normals, mask), np.where(mask, code, BACKGROUND))


@given(seeds, arrays(bool, (1, 12, 16)), st.integers(1, 14), st.booleans())
def test_error_does_not_cross_the_silhouette(seed, mask, gap, upright):
    mask = mask.copy() if upright else mask.swapaxes(1, 2).copy()
    one, other = mask.copy(), mask.copy()
    cut = (slice(None), slice(None), gap) if upright else (slice(None), gap)
    after = (slice(None), slice(None), slice(gap, None)) if upright else (slice(None), slice(gap, None))
    before = (slice(None), slice(None), slice(gap)) if upright else (slice(None), slice(gap))
    mask[cut] = False
    one[after], other[before], other[cut] = False, False, False
    normals = random_normals(seed, mask.shape)
    apart = np.where(one, dither(normals, one), dither(normals, other))
    np.testing.assert_array_equal(dither(normals, mask), apart)


@given(seeds, arrays(bool, (1, 8, 8)))
def test_what_lies_outside_the_silhouette_is_never_read(seed, mask):
    normals = random_normals(seed, mask.shape)
    hidden = np.where(mask[..., None], normals, np.float32(np.nan))
    np.testing.assert_array_equal(dither(normals, mask), dither(hidden, mask))


@given(facing_normals(radius=0.85))
def test_the_mean_over_a_flat_surface_is_its_normal(normal):
    flat = np.broadcast_to(normal.astype(np.float32), (1, 48, 48, 3))
    mean = decode(dither(flat, np.ones((1, 48, 48), bool)))[0, 8:, 8:].mean(axis=(0, 1))
    assert np.linalg.norm(mean - normal) < 0.02
