"""The robust fit: shadows and highlights move it less, and clean photographs not at all."""

import numpy as np
import pytest
from PIL import Image

from bake import robust
from bake.held_out import score
from bake.photographs import open_photographs
from bake.ptm import fit_ptm
from bake.small_products import multiply, solve_symmetric
from impostor.files.lp_file import read_lp
from impostor.ptm.normals import normals
from impostor.ptm.polynomials import evaluate
from impostor.srgb import srgb_from_linear
from tests.captures import LIGHTS, known_polynomials, photographed, write_photographs
from tests.data import DATA, needs_data

SYNTHRTI = DATA / "rti" / "synthrti"


def spoiled_slopes(folder):
    """Photographs of diffuse slopes, a few samples of which are shadow or highlight; and the slopes' normals."""
    rng = np.random.default_rng(0)
    tilt = rng.uniform(-0.35, 0.35, (12, 12, 2))
    truth = np.concatenate([tilt, np.ones((12, 12, 1))], axis=-1)
    truth /= np.linalg.norm(truth, axis=-1, keepdims=True)
    light = 0.5 * np.maximum(np.einsum("hwc,nc->nhw", truth, LIGHTS), 0)
    draw = rng.uniform(size=light.shape)
    light[draw < 0.12] *= 0.05
    light[draw > 0.92] = 0.95
    pictures = np.rint(srgb_from_linear(light) * 255).astype(np.uint8)
    return open_photographs(write_photographs(folder, np.repeat(pictures[..., None], 3, axis=-1))), truth


def angular_error(polynomials, truth):
    """Mean angle between normals, in degrees."""
    return np.degrees(np.arccos(np.clip((normals(polynomials) * truth).sum(axis=-1), -1, 1))).mean()


def test_normals_of_spoiled_photographs_come_nearer_to_the_truth(tmp_path):
    photographs, truth = spoiled_slopes(tmp_path)
    plain, better = (fit_ptm(photographs, LIGHTS[:, :2], robust=choice) for choice in (False, True))
    assert angular_error(better, truth) < 0.6 * angular_error(plain, truth)


def test_many_small_bands_give_what_one_gives(tmp_path, monkeypatch):
    photographs, _ = spoiled_slopes(tmp_path)
    whole = fit_ptm(photographs, LIGHTS[:, :2], format="rgb", robust=True)
    monkeypatch.setattr(robust, "BAND_BYTES", 30 * 3 * 25)
    steps = []
    parts = fit_ptm(
        photographs, LIGHTS[:, :2], format="rgb", robust=True, progress=lambda done, total: steps.append((done, total))
    )
    np.testing.assert_allclose(parts.coefficients, whole.coefficients, atol=1e-5)
    assert steps[-1] == (36, 36)


def test_photographs_that_are_polynomials_keep_their_coefficients(tmp_path):
    known = known_polynomials()
    photographs = open_photographs(write_photographs(tmp_path, photographed(known, LIGHTS[:, :2])))
    found = fit_ptm(photographs, LIGHTS[:, :2], format="rgb", robust=True, meaning="view")
    assert np.abs(found.coefficients - known).max() < 0.015


def test_many_small_systems_are_solved_as_numpy_does():
    rng = np.random.default_rng(0)
    roots, right = rng.normal(size=(50, 6, 6)), rng.normal(size=(50, 6, 2))
    matrices = roots @ roots.swapaxes(1, 2) + 0.1 * np.eye(6)
    found = solve_symmetric(np.moveaxis(matrices, 0, -1).copy(), right.swapaxes(0, 1).copy())
    np.testing.assert_allclose(found.swapaxes(0, 1), np.linalg.solve(matrices, right), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("columns", [1, 7, 40_000])
def test_products_by_pieces_are_products(columns):
    left, right = np.random.default_rng(0).normal(size=(6, 9)), np.random.default_rng(1).normal(size=(3, 9, columns))
    np.testing.assert_allclose(multiply(left, right), left @ right, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize(("unexplained", "trusted"), [(0.02, False), (0.5, True)])
def test_bright_samples_lose_weight_where_the_polynomial_explains_the_rest(unexplained, trusted):
    values = np.linspace(0.2, 0.9, 40, dtype=np.float32)[:, None]
    residual = np.resize([1, -1], (40, 1)) * np.sqrt(unexplained) * values.std()
    weights = robust._highlight_weights(values, residual)[:, 0]
    if trusted:
        assert (weights == 1).all()
    else:
        assert (np.diff(weights) < 0).all()
        assert weights[0] > 0.9
        assert weights[-1] < 0.1


@needs_data
@pytest.mark.parametrize(
    ("name", "plain_db", "lost_db"),
    [("Object1/material1", 29.18, 0.0), ("Object1/material4", 34.67, 1.5), ("Object2/material2", 22.79, 0.1)],
)
def test_real_sets_gain_a_quarter_of_their_normals_error(name, plain_db, lost_db):
    dome, test = (read_lp(SYNTHRTI / name / part / "dirs.lp") for part in ("Dome", "Test"))
    truth = np.asarray(Image.open(SYNTHRTI / name / "Test" / "normals.png").convert("RGB")) / 127.5 - 1
    truth /= np.linalg.norm(truth, axis=-1, keepdims=True)
    errors, psnr = [], []
    for choice in (False, True):
        found = fit_ptm(open_photographs(dome.photographs), dome.directions[:, :2], format="rgb", robust=choice)
        errors.append(angular_error(found, truth))
        held_out = score(
            lambda u, v, found=found: evaluate(found, u, v),
            found.size,
            open_photographs(test.photographs),
            test.directions[:, :2],
        )
        psnr.append(held_out.psnr_db)
    assert errors[1] < 0.75 * errors[0]
    assert psnr[1] > psnr[0] - lost_db
    assert psnr[0] == pytest.approx(plain_db, abs=0.01)
