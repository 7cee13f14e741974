"""The 225 normals, their codes and the dither, against the paper's rule written out and against pictures."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from impostor.errors import SettingsError
from impostor.normal_code import (
    BACKGROUND,
    BYTE_TO_NORMAL,
    CODE_COUNT,
    CODE_TO_CELL,
    decode,
    dither,
    encode,
    mip_codes,
    palette,
)

LIGHTS = {"front left": (-0.5, 0.5, 0.7), "right": (1, 0.2, 0.3), "grazing top": (0.1, 1, 0.15)}


def sphere(size=256):
    """Normals and silhouette of a sphere inscribed in the image, and the distance of each pixel from its axis."""
    step = (np.arange(size) + 0.5) / size * 2 - 1
    x, y = np.meshgrid(step, -step)
    normals = np.stack([x, y, np.sqrt(np.clip(1 - x**2 - y**2, 0, None))], axis=-1).astype(np.float32)
    return normals, x**2 + y**2 < 1, np.hypot(x, y)


def blurred_shading(normals, mask, light):
    shading = np.maximum(normals @ (np.array(light) / np.linalg.norm(light)), 0)
    return gaussian_filter(shading * mask, 3) / np.maximum(gaussian_filter(mask.astype(float), 3), 1e-9)


def constant(normal, shape):
    return np.broadcast_to(np.array(normal, np.float32), (*shape, 3))


def test_the_table_is_the_papers():
    cells = [(i, j) for j in range(-8, 9) for i in range(-8, 9) if i * i + j * j <= 72.25]
    assert len(cells) == CODE_COUNT == 225
    assert CODE_TO_CELL.dtype == np.int8
    assert CODE_TO_CELL.tolist() == [list(cell) for cell in cells]
    expected = [(i / 8.5, j / 8.5, (1 - (i / 8.5) ** 2 - (j / 8.5) ** 2) ** 0.5) for i, j in cells]
    assert BYTE_TO_NORMAL.dtype == np.float32
    assert BYTE_TO_NORMAL.shape == (256, 3)
    np.testing.assert_allclose(BYTE_TO_NORMAL[:225], expected, atol=1e-7)
    assert not BYTE_TO_NORMAL[225:].any()


def test_landmarks_of_the_code_order():
    assert encode(np.array([0.0, 0.0, 1.0])) == 112
    x, y, _ = BYTE_TO_NORMAL[:225].T
    assert y[0] < 0 < y[224]
    assert x[0] < x[1]
    np.testing.assert_array_equal(BYTE_TO_NORMAL[:225, :2], -BYTE_TO_NORMAL[224::-1, :2])


def test_the_tables_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        BYTE_TO_NORMAL[0] = 0
    with pytest.raises(ValueError, match="read-only"):
        CODE_TO_CELL[0] = 0


def test_a_normal_across_the_view_is_not_representable():
    code = encode(np.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(decode(code), [8 / 8.5, 0, (1 - (8 / 8.5) ** 2) ** 0.5], atol=1e-6)


def test_a_normal_that_faces_away_is_taken_to_the_rim():
    away = np.array([[0.3, 0.4, -(0.75**0.5)]])
    np.testing.assert_array_equal(encode(away), encode(np.array([[0.6, 0.8, 0.0]])))


def test_background_is_neither_encoded_nor_decoded():
    normals = np.full((2, 2, 3), np.nan, np.float32)
    normals[0, 0] = 0, 0, 1
    mask = np.array([[True, False], [False, False]])
    codes = encode(normals, mask)
    np.testing.assert_array_equal(codes, [[112, 255], [255, 255]])
    np.testing.assert_array_equal(dither(normals[None], mask[None])[0], codes)
    np.testing.assert_array_equal(decode(codes)[~mask], 0)


def test_the_palette_is_a_normal_map():
    colors = palette()
    assert colors.dtype == np.uint8
    assert colors.shape == (256, 3)
    np.testing.assert_array_equal(colors[112], [128, 128, 255])
    assert np.abs(colors[:225] / 127.5 - 1 - BYTE_TO_NORMAL[:225]).max() <= 0.5 / 127.5 + 1e-6
    assert not colors[225:].any()


@pytest.mark.parametrize("light", LIGHTS.values(), ids=LIGHTS.keys())
def test_dithering_at_least_halves_the_shading_error_of_a_sphere(light):
    normals, mask, distance = sphere()
    truth = blurred_shading(normals, mask, light)
    plain = blurred_shading(decode(encode(normals, mask)), mask, light) - truth
    dithered = blurred_shading(decode(dither(normals[None], mask[None])[0]), mask, light) - truth

    def rms(error, where):
        return np.sqrt((error[where] ** 2).mean())

    assert rms(dithered, distance < 0.8) <= 0.5 * rms(plain, distance < 0.8)
    assert rms(dithered, mask) <= rms(plain, mask)


def test_a_surface_beyond_the_grid_does_not_stain_the_one_below_it():
    roof, wall = (0, np.cos(0.15), np.sin(0.15)), (0, 0, 1)
    normals = np.concatenate([constant(roof, (1, 60, 60)), constant(wall, (1, 60, 60))], axis=1)
    codes = dither(normals, np.ones((1, 120, 60), bool))
    assert (codes[0, 60:] != 112).sum() <= 60
    assert (codes[0, 62:] != 112).sum() <= 3


def test_only_the_silhouette_decides_what_a_view_gets_not_its_neighbours():
    rng = np.random.default_rng(0)
    normals, disc, _ = sphere(24)
    masks = np.stack([np.roll(disc, k % 5, axis=1) & (rng.random((24, 24)) < 0.9) for k in range(40)])
    masks[7] = False
    views = np.repeat(normals[None], 40, axis=0)
    views[~np.broadcast_to(disc, masks.shape)] = 0, 0, 1
    together = dither(views, masks)
    np.testing.assert_array_equal(together == BACKGROUND, ~masks)
    for k in (0, 6, 7, 8, 39):
        np.testing.assert_array_equal(together[k], dither(views[k : k + 1], masks[k : k + 1])[0])


def shortfalls(normals, mask, codes):
    """How far each code of one view is from the best choice, found pixel by pixel: cosine of the best less its own."""
    height, width = mask.shape
    target = np.where(mask[..., None], normals, 0).astype(float)
    table = BYTE_TO_NORMAL[:225].astype(float)
    out = np.zeros(mask.shape)
    for y, x in np.argwhere(mask):
        cosines = table @ target[y, x] / np.linalg.norm(target[y, x])
        out[y, x] = cosines.max() - cosines[codes[y, x]]
        error = np.clip((target[y, x] - table[codes[y, x]]) * (1, 1, 0.9), -1 / 8.5, 1 / 8.5)
        shares = {(y, x + 1): 7, (y + 1, x - 1): 3, (y + 1, x): 5, (y + 1, x + 1): 1}
        shares = {(b, a): s for (b, a), s in shares.items() if b < height and 0 <= a < width and mask[b, a]}
        for place, share in shares.items():
            target[place] += error * share / sum(shares.values())
    return out[mask]


def test_the_wavefront_chooses_what_a_pixel_by_pixel_dither_would():
    normals, mask, _ = sphere(48)
    mask = mask & (np.random.default_rng(1).random(mask.shape) < 0.95)
    off = shortfalls(normals, mask, dither(normals[None], mask[None])[0])
    assert (off < 1e-9).mean() > 0.97
    assert off.mean() < 2e-5


def test_mip_levels_hold_the_mean_of_what_is_covered():
    left, right = np.array([-0.6, 0, 0.8], np.float32), np.array([0.6, 0, 0.8], np.float32)
    normals = constant(left, (1, 4, 4)).copy()
    normals[:, :, 1::2] = right
    coverage = np.ones((1, 4, 4), np.float32)
    coverage[0, 2:, 1::2] = 0
    coverage[0, :2, 2:] = 0
    mask = np.ones((1, 4, 4), bool)
    levels = mip_codes(normals, coverage, 3, mask)
    assert [level.shape for level in levels] == [(1, 4, 4), (1, 2, 2), (1, 1, 1)]
    assert (levels[0] != BACKGROUND).all()
    up, one_side = encode(np.array([0.0, 0.0, 1.0])), encode(left)
    assert levels[1][0, 0, 0] == up
    assert levels[1][0, 0, 1] == BACKGROUND
    assert levels[1][0, 1, 0] == one_side
    mean = np.array([-0.3, 0, 0.8]) / np.hypot(0.3, 0.8)
    assert levels[2].item() == encode(mean)


def test_coverage_weighs_the_mean_and_the_least_of_it_counts():
    normals = np.array([[[[0.6, 0, 0.8], [-0.6, 0, 0.8]]]], np.float32)
    assert mip_codes(normals, np.array([[[1e-20, 0]]], np.float32), 2)[1].item() == encode(normals)[0, 0, 0]
    weighted = decode(mip_codes(normals, np.array([[[1, 0.25]]], np.float32), 2)[1]).squeeze()
    assert np.hypot(*(weighted - np.array([0.36, 0, 0.8]) / np.hypot(0.36, 0.8))[:2]) < 0.09


def test_an_odd_image_keeps_its_last_row_and_column_in_every_mip_level():
    normals = constant((0, 0, 1), (2, 5, 3))
    coverage = np.zeros((2, 5, 3), np.float32)
    coverage[:, 4, 2] = 0.5
    levels = mip_codes(normals, coverage, 4)
    assert [level.shape[1:] for level in levels] == [(5, 3), (3, 2), (2, 1), (1, 1)]
    for level in levels:
        assert level[0, -1, -1] == 112
        assert (level != BACKGROUND).sum() == 2


def test_a_mip_level_of_a_sphere_shades_like_the_sphere():
    normals, mask, _ = sphere()
    level = mip_codes(normals[None], mask[None].astype(np.float32), 3)[2][0]
    small, small_mask, small_distance = sphere(64)
    inside = small_distance < 0.9
    for light in LIGHTS.values():
        error = blurred_shading(decode(level), small_mask, light) - blurred_shading(small, small_mask, light)
        assert np.sqrt((error[inside] ** 2).mean()) < 0.02


NORMALS, MASK = constant((0, 0, 1), (1, 4, 4)), np.ones((1, 4, 4), bool)
COVERAGE = MASK.astype(np.float32)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: encode(np.zeros((4, 2))), r"normals: shape is \(4, 2\); expected \(\.\.\., 3\)"),
        (lambda: encode(np.zeros((4, 3), int)), "normals: dtype is int64; expected a floating-point one"),
        (lambda: encode(NORMALS * 0.5), r"normals: length at \(0, 0, 0\) is 0.5; expected 1 within 0.02"),
        (lambda: encode(NORMALS * np.nan), r"normals: length at \(0, 0, 0\) is nan"),
        (lambda: encode(NORMALS, MASK[0]), r"mask: shape is \(4, 4\); expected \(1, 4, 4\)"),
        (lambda: encode(NORMALS, COVERAGE), "mask: dtype is float32; expected bool"),
        (lambda: decode(np.zeros(3, int)), "codes: dtype is int64; expected uint8"),
        (lambda: dither(NORMALS[0], MASK[0]), r"normals: shape is \(4, 4, 3\); expected \(V, H, W, 3\)"),
        (lambda: dither(NORMALS, MASK[:, :2]), r"mask: shape is \(1, 2, 4\); expected \(1, 4, 4\)"),
        (lambda: mip_codes(NORMALS, COVERAGE[:, :2], 1, MASK), r"coverage: shape is \(1, 2, 4\); expected \(1, 4, 4\)"),
        (lambda: mip_codes(NORMALS, MASK, 1), "coverage: dtype is bool; expected a floating-point one"),
        (lambda: mip_codes(NORMALS, COVERAGE * 2, 1), r"coverage: holds 2; expected 0\.\.1"),
        (lambda: mip_codes(NORMALS, COVERAGE, 4), r"level_count: 4; expected 1\.\.3 for 4x4"),
        (lambda: mip_codes(NORMALS, COVERAGE, 0), r"level_count: 0; expected 1\.\.3"),
        (lambda: mip_codes(NORMALS, COVERAGE, 1, ~MASK), "mask: a texel with coverage is outside"),
    ],
)
def test_wrong_input_is_named_with_its_value_and_what_was_expected(call, message):
    with pytest.raises(SettingsError, match=message):
        call()
