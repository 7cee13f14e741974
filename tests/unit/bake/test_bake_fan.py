"""What a bake puts into a fan, on objects whose answer is known."""

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from bake.fan import DILATION, FARTHEST, STEEPEST_PLANE, bake_fan
from impostor.errors import ModelError, SettingsError
from impostor.model import Material, Model
from impostor.normal_code import BYTE_TO_NORMAL
from impostor.views import MAX_VIEWS
from tests.solids import RED, Box, Sphere, solid_model

SQUARE = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
SQUARE_FACES = [[0, 1, 2], [0, 2, 3]]


def square_about(axis, angle, at=(0.0, 0.0, 0.0)):
    """A square of 2 m that faces +Z, turned about x or y."""
    cos, sin = np.cos(angle), np.sin(angle)
    turn = {"x": [[1, 0, 0], [0, cos, -sin], [0, sin, cos]], "y": [[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]]}[axis]
    return Model.from_arrays(SQUARE @ np.array(turn, float).T + at, SQUARE_FACES)


def texel_points(fan, index):
    """Model-space points (N, 3) of one view's silhouette, from its depth."""
    view, mask = fan.views[index], fan.silhouette[index]
    rows, columns = np.nonzero(mask)
    across = (np.arange(fan.size) + 0.5) * (2 / fan.size) - 1
    low, high = view.depth_range
    z = low + fan.depth[index][mask] / 65535 * (high - low)
    return view.unproject(np.stack([across[columns] * view.radius, -across[rows] * view.radius, z], axis=-1))


@pytest.fixture(scope="module")
def ball():
    return bake_fan(solid_model(Sphere(center=(0.5, 1.0, -0.25))), views=5, elevation_deg=10, size=64)


# --- planes


@pytest.mark.parametrize(
    ("axis", "angle", "slopes"),
    [
        ("x", 0.0, (0, 0)),
        ("x", -0.6, (0, -np.tan(0.6))),  # its top leans back, away from the camera
        ("x", 0.6, (0, np.tan(0.6))),
        ("y", 0.5, (-np.tan(0.5), 0)),  # its right side is turned away
    ],
)
def test_a_tilted_square_is_its_own_plane(axis, angle, slopes):
    fan = bake_fan(square_about(axis, angle), views=1, elevation_deg=0, size=64, samples=4)
    np.testing.assert_allclose(fan.views.plane[0], [0, *slopes], atol=0.02)


def test_the_offset_of_a_plane_is_measured_from_the_views_centre():
    # Two thirds of what is seen lie 1 m nearer than the rest: the plane is the least-squares one, half way back.
    model = solid_model(Box((-1.5, -1, -0.5), (0.5, 1, 0.5)), Box((0.5, -1, -0.5), (1.5, 1, -0.4)))
    fan = bake_fan(model, views=1, elevation_deg=0, size=96)
    x = np.linspace(-1.5, 1.5, 30001)[:-1]
    slope, offset = np.polyfit(x, np.where(x < 0.5, 0.5, -0.4), 1)
    np.testing.assert_allclose(fan.views.plane[0], [offset / 2, slope, 0], atol=0.02)
    np.testing.assert_allclose(fan.views.center[0], [0, 0, 0], atol=1e-6)


def test_a_plane_is_never_steeper_than_a_quad_can_bear():
    fan = bake_fan(square_about("y", np.radians(80)), views=1, elevation_deg=0, size=64, samples=4)
    offset, right, up = fan.views.plane[0]
    assert np.hypot(right, up) == pytest.approx(STEEPEST_PLANE)
    assert (right, offset) == (pytest.approx(-STEEPEST_PLANE), pytest.approx(0, abs=0.05))


def test_a_perspective_view_has_an_offset_and_no_slope():
    fan = bake_fan(square_about("x", -0.4, at=(0, 0, 1)), views=1, elevation_deg=0, size=64, distance=6)
    assert fan.views.distance == 6
    assert fan.views.plane[0].tolist() == [pytest.approx(0, abs=0.1), 0, 0]


def test_a_view_that_sees_nothing_has_its_plane_through_the_centre():
    fan = bake_fan(square_about("y", 0.0), views=4, elevation_deg=0, size=32)
    assert [bool(mask.any()) for mask in fan.silhouette] == [True, False, True, False]
    assert fan.views.plane[1].tolist() == [0, 0, 0]


# --- layers


@pytest.mark.parametrize("distance", [np.inf, 4.0])
def test_texels_are_where_the_surface_is(distance):
    sphere = Sphere(center=(0.5, 1.0, -0.25))
    fan = bake_fan(solid_model(sphere), views=5, elevation_deg=10, size=64, distance=distance)
    for index, view in enumerate(fan.views):
        points = texel_points(fan, index)
        assert len(points) > 2000
        off = np.abs(np.linalg.norm(points - sphere.center, axis=-1) - 1)
        assert np.median(off) < 0.005  # a texel is 0.033 m
        toward = view.basis[2] if np.isinf(distance) else view.center + distance * view.basis[2] - points
        assert np.all(np.sum((points - sphere.center) * toward, axis=-1) > -0.2)


def test_normals_are_those_of_the_surface(ball):
    for index, view in enumerate(ball.views):
        points = texel_points(ball, index)
        wanted = (points - [0.5, 1.0, -0.25]) @ view.basis.T
        found = BYTE_TO_NORMAL[ball.normal[0][index][ball.silhouette[index]]]
        inside = wanted[:, 2] > 0.3
        # Codes are dithered: single ones are off by a cell, 1/8.5, and their mean is not.
        assert np.abs(found - wanted)[inside].mean() < 0.06
        assert np.abs((found - wanted)[inside].mean(axis=0)[:2]).max() < 0.01


def test_the_silhouette_is_half_coverage(ball):
    assert np.array_equal(ball.silhouette, ball.color[..., 3] >= 128)
    assert len(np.unique(ball.color[..., 3])) > 3


def test_layers_go_on_for_two_texels_past_the_silhouette_and_alpha_does_not(ball):
    covered = ball.color[..., 3] > 0
    for index in range(len(ball.views)):
        away = distance_transform_edt(~covered[index])
        ring, beyond = (away > 0) & (away <= DILATION), away > DILATION
        assert DILATION == 2
        assert np.all(ball.normal[0][index][ring] != 255)
        assert np.all(ball.color[index][ring][:, :3] > 0)
        assert np.all(ball.depth[index][ring] > 0)
        assert np.all(ball.normal[0][index][beyond] == 255)
        assert not ball.color[index][beyond].any()
        assert not ball.depth[index][beyond].any()


def test_depth_has_12_bits(ball):
    assert not np.any(ball.depth & 15)
    assert len(np.unique(ball.depth)) > 500
    assert ball.depth.max() > 65000


def test_normal_levels_halve_down_to_four_texels(ball):
    assert [codes.shape[-1] for codes in ball.normal] == [64, 32, 16, 8, 4]
    odd = bake_fan(solid_model(Sphere()), views=2, size=36)
    assert [codes.shape[-1] for codes in odd.normal] == [36, 18, 9]


# --- albedo


def test_an_untextured_model_has_one_albedo(ball):
    assert ball.uniform_albedo is not None
    np.testing.assert_allclose(ball.uniform_albedo, 188, atol=1)


def test_two_colours_are_not_one_albedo():
    fan = bake_fan(solid_model(Sphere(), Box((1, 0, 0), (2, 1, 1), RED)), views=2, size=48)
    assert fan.uniform_albedo is None


def test_a_texture_is_not_one_albedo_and_takes_more_samples():
    texture = np.full((2, 2, 4), 255, np.uint8)
    texture[0, 0, :3] = RED
    material = Material(texture=texture)
    uvs = (SQUARE[:, :2] + 1) / 2
    fan = bake_fan(Model.from_arrays(SQUARE, SQUARE_FACES, uvs=uvs, material=material), views=2, size=32)
    assert fan.uniform_albedo is None
    assert fan.settings["samples"] == 4


# --- what is recorded, reported and refused


def test_settings_are_recorded_as_the_command_line_spells_them():
    model = Model.from_arrays(SQUARE, SQUARE_FACES, name="square")
    fan = bake_fan(model, views=3, elevation_deg=20.5, size=24, distance=5.0, samples=1, up="z")
    assert fan.settings == {
        "views": 3,
        "elevation": 20.5,
        "layout": "ring",
        "size": 24,
        "perspective": 5.0,
        "samples": 1,
        "up": "z",
    }
    assert (fan.name, fan.layout, len(fan.views)) == ("square", "ring", 3)
    assert fan.source == {"name": "square", "sha256": ""}
    np.testing.assert_allclose(fan.bounds, model.bounds)
    assert fan.radius == model.radius
    settings = bake_fan(model, views=1, size=16).settings
    assert (settings["perspective"], settings["samples"], settings["elevation"]) == (None, 2, 15)
    assert bake_fan(model, views=1, size=16, layout="hemisphere").settings["elevation"] is None


def test_progress_is_called_once_a_view():
    calls = []
    bake_fan(solid_model(Sphere()), views=20, size=16, progress=lambda *call: calls.append(call))
    assert calls == [(done, 20) for done in range(1, 21)]


def test_an_error_in_progress_stops_the_bake():
    """So does Ctrl-C, wherever it strikes."""

    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        bake_fan(solid_model(Sphere()), views=20, size=16, progress=stop)


def test_the_same_model_twice_is_the_same_fan(ball):
    again = bake_fan(solid_model(Sphere(center=(0.5, 1.0, -0.25))), views=5, elevation_deg=10, size=64)
    for one, other in zip(
        (ball.color, ball.depth, *ball.normal, ball.views.plane),
        (again.color, again.depth, *again.normal, again.views.plane),
        strict=True,
    ):
        assert np.array_equal(one, other)


@pytest.mark.parametrize(
    ("options", "parameter"),
    [
        ({"views": 0}, "views"),
        ({"views": MAX_VIEWS + 1}, "views"),
        ({"size": 7}, "size"),
        ({"size": 4097}, "size"),
        ({"elevation_deg": 90}, "elevation"),
        ({"layout": "cube"}, "layout"),
        ({"layout": "sphere", "elevation_deg": 15}, "elevation"),
        ({"distance": 1.0}, "distance"),
        ({"distance": 2 * FARTHEST}, "distance"),
        ({"distance": np.nan}, "distance"),
        ({"samples": 3}, "samples"),
    ],
)
def test_numbers_out_of_range_are_refused(options, parameter):
    with pytest.raises(SettingsError) as caught:
        bake_fan(solid_model(Sphere()), **{"views": 2, "size": 16, **options})
    assert caught.value.where == parameter
    assert "expected" in caught.value.problem


def test_an_object_that_no_view_sees_is_refused():
    with pytest.raises(SettingsError, match="no texel of any view"):
        bake_fan(square_about("x", np.pi / 2), views=4, elevation_deg=0, size=32)


def test_an_object_whose_alpha_cuts_all_of_it_out_is_refused_as_that():
    clear = Material(base_color=(1.0, 1.0, 1.0, 0.4), alpha_mode="MASK")
    with pytest.raises(ModelError, match="no texel of any view; expected a model whose alpha does not cut all of it"):
        bake_fan(Model.from_arrays(SQUARE, SQUARE_FACES, material=clear), views=2, size=16)
