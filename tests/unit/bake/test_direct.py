"""Direct rendering: photographs at their own lights, blends between them, the rim outside."""

import numpy as np
import pytest

from bake.direct import LightTriangulation, render_direct
from bake.photographs import open_photographs
from impostor.errors import SettingsError
from tests.captures import LIGHTS, write_photographs

UV = LIGHTS[:, :2]


@pytest.fixture
def photographs(tmp_path):
    pictures = np.random.default_rng(0).integers(0, 256, (30, 4, 5, 3)).astype(np.uint8)
    return open_photographs(write_photographs(tmp_path, pictures))


def test_at_a_photographs_own_light_it_is_that_photograph(photographs):
    mesh = LightTriangulation(UV)
    for index in (0, 7, 29):
        drawn = render_direct(photographs, mesh, *UV[index])
        np.testing.assert_allclose(drawn, photographs.decode(index) / 255, atol=1e-5)


def test_weights_are_barycentric_and_change_without_a_jump():
    mesh = LightTriangulation(UV)
    for point in np.random.default_rng(1).uniform(-0.6, 0.6, (50, 2)):
        indices, weights = mesh.weights(*point)
        assert weights.min() > 0 and weights.sum() == pytest.approx(1)
        np.testing.assert_allclose(weights @ UV[indices], point, atol=1e-9)
    path = np.linspace([-1.2, -0.3], [1.2, 0.5], 4000)
    dense = np.zeros((len(path), len(UV)))
    for row, point in zip(dense, path, strict=True):
        indices, weights = mesh.weights(*point)
        row[indices] = weights
    assert np.abs(np.diff(dense, axis=0)).max() < 0.05


def test_outside_it_is_the_nearest_point_of_the_rim():
    square = LightTriangulation([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    indices, weights = square.weights(0.9, 0.25)
    assert dict(zip(indices.tolist(), weights.tolist(), strict=True)) == pytest.approx({1: 0.25, 2: 0.75})
    indices, weights = square.weights(-0.9, 0.8)
    assert (indices.tolist(), weights.tolist()) == ([3], [1.0])


@pytest.mark.parametrize("lights", [UV[:2], [[-1, 0], [0, 0], [0.5, 0], [1, 0]], [[0.1, 0.2]] * 5])
def test_lights_without_a_triangle_are_refused(lights):
    with pytest.raises(SettingsError, match="line|at least 3"):
        LightTriangulation(lights)


def test_a_light_that_is_no_number_is_refused():
    with pytest.raises(SettingsError, match="finite"):
        LightTriangulation(UV).weights(float("nan"), 0)
