"""Copies of a fan: their arrays, and the quad that each shows to a viewer."""

import numpy as np
import pytest

from impostor.errors import SettingsError
from impostor.lighting import Gloss
from impostor.views import direction, frame, layout_bases, rotation_about_y
from runtime import Instances
from runtime.instances.placement import ViewVectors
from runtime.instances.quads import nearest_views, quads_toward
from runtime.viewing.cameras import Camera
from runtime.viewing.viewer import Viewer
from tests.solids import Sphere, solid_fan

FAN = solid_fan(Sphere((0.5, 0.2, 0.0)), views=8, size=16, elevation_deg=10, slopes=(0.1, 0.2, -0.3))
NEAR = solid_fan(Sphere((0.5, 0.2, 0.0)), views=8, size=16, distance=5.0, slopes=(0.3, 0.0, 0.0))


def test_one_copy_at_the_origin_by_default():
    one = Instances(FAN)
    assert len(one) == 1
    assert (one.positions.tolist(), one.yaws.tolist(), one.scales.tolist()) == ([[0, 0, 0]], [0], [1])
    assert one.gloss == Gloss()
    assert one.visible.all()


def test_one_yaw_and_scale_serve_all_and_may_then_be_written_one_by_one():
    three = Instances(FAN, np.zeros((3, 3)), 0.5, 2.0)
    three.yaws[1] = 1
    three.scales[2] = 3
    assert (three.yaws.tolist(), three.scales.tolist()) == ([0.5, 1, 0.5], [2, 2, 3])


def test_the_callers_arrays_are_copied():
    mine = np.zeros((2, 3))
    Instances(FAN, mine).positions[:] = 7
    assert not mine.any()


@pytest.mark.parametrize("positions", [np.zeros((0, 3)), []])
def test_no_copies_at_all(positions):
    none = Instances(FAN, positions)
    assert len(none) == 0
    assert len(quads_toward(none, np.array([0, 0, 9, 1.0]))) == 0


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ((np.zeros((4, 2)),), "positions of shape (4, 2); expected (N, 3)"),
        ((np.zeros((4, 3)), np.zeros(3)), "yaws of shape (3,); expected (4,)"),
        ((np.zeros((4, 3)), 0, np.zeros((4, 1))), "scales of shape (4, 1); expected (4,)"),
        (((0, np.nan, 0),), "positions with a number that is not finite"),
        (((0, 0, 0), np.inf), "yaws with a number that is not finite"),
        (((0, 1e15, 0),), "positions reach 1e+15; expected less than 1e+15"),
        (((0, 0, 0), -1e40), "yaws reach 1e+40; expected less than 1e+15"),
        (((0, 0, 0), 0, 1e300), "scales reach 1e+300; expected less than 1e+15"),
        (((0, 0, 0), 0, 0), "scales go down to 0; expected more than 0"),
        (((0, 0, 0), 0, -2), "scales go down to -2"),
        (("here",), "positions is a str; expected numbers of shape (N, 3)"),
        (([[0, 0, 0], [1]],), "positions is a list; expected numbers"),
    ],
)
def test_impossible_places_are_refused(arguments, problem):
    with pytest.raises(SettingsError) as caught:
        Instances(FAN, *arguments)
    assert str(caught.value).startswith(f"solids: {problem}")


def test_what_replaces_an_array_is_written_into_it():
    copies = Instances(FAN, np.zeros((3, 3)))
    held = copies.positions, copies.yaws, copies.scales, copies.visible
    copies.positions, copies.yaws = [[0, 0, 1], [0, 0, 2], [0, 0, 3]], 0.5
    copies.scales, copies.visible = (1, 2, 3), [True, False, True]
    copies.positions += 1
    for array, now in zip(held, (copies.positions, copies.yaws, copies.scales, copies.visible), strict=True):
        assert array is now
    assert copies.positions[:, 2].tolist() == [2, 3, 4]
    assert (copies.yaws.tolist(), copies.scales.tolist()) == ([0.5] * 3, [1, 2, 3])
    assert (copies.visible.dtype, copies.visible.tolist()) == (bool, [True, False, True])


@pytest.mark.parametrize(
    ("name", "values", "problem"),
    [
        ("positions", np.zeros((2, 3)), "positions of shape (2, 3); expected (3, 3)"),
        ("positions", [[np.nan, 0, 0]] * 3, "positions with a number that is not finite"),
        ("positions", "there", "positions is a str; expected numbers of shape (3, 3)"),
        ("yaws", [0, 1], "yaws of shape (2,); expected (3,) or ()"),
        ("yaws", np.inf, "yaws with a number that is not finite"),
        ("scales", [1, 0, 1], "scales go down to 0; expected more than 0"),
        ("visible", [True], "visible of shape (1,); expected (3,) or ()"),
    ],
)
def test_what_cannot_replace_an_array_is_refused_and_changes_nothing(name, values, problem):
    copies = Instances(FAN, np.ones((3, 3)), 0.25, 2.0)
    before = getattr(copies, name).copy()
    with pytest.raises(SettingsError) as caught:
        setattr(copies, name, values)
    assert str(caught.value).startswith(f"solids: {problem}")
    np.testing.assert_array_equal(getattr(copies, name), before)


def test_copies_whose_numbers_became_impossible_are_left_out():
    copies = Instances(FAN, np.zeros((6, 3)))
    copies.positions[0, 1], copies.yaws[1], copies.scales[2:5] = np.nan, np.inf, (np.inf, 0, -1)
    assert quads_toward(copies, np.array([0, 0, 1.0, 0])).index.tolist() == [5]


@pytest.mark.parametrize("gloss", [0.3, "shiny"])
def test_only_a_gloss_is_one(gloss):
    with pytest.raises(SettingsError, match=r"^gloss: a \w+; expected a Gloss$"):
        Instances(FAN, gloss=gloss)


def test_a_turned_copy_shows_the_view_that_its_turn_brings_round():
    copies = Instances(FAN, np.tile((3.0, 0, -2), (8, 1)), np.arange(8) * np.pi / 4)
    views = nearest_views(copies, np.append(direction(0.1, 0.3), 0), np.arange(8))
    assert views.tolist() == [0, 7, 6, 5, 4, 3, 2, 1]


@pytest.mark.parametrize("layout", ["ring", "hemisphere", "sphere"])
@pytest.mark.parametrize("count", [1, 2, 7, 96])
def test_the_nearest_view_is_the_one_that_the_views_name(layout, count):
    views = frame(layout_bases(layout, count, 0.3), np.array([[-1.0, -1, -1], [1, 1, 1]]), 16)
    toward = np.random.default_rng(0).normal(size=(5000, 3))
    found = ViewVectors(views).nearest(*toward.T)
    cosines = np.einsum("ni,ni->n", toward, views.basis[found, 2])
    np.testing.assert_allclose(cosines, (toward @ views.basis[:, 2].T).max(axis=1), rtol=0, atol=1e-12)


def test_each_copy_looks_at_the_eye_from_where_it_stands():
    copies = Instances(FAN, [(0, 0, -50), (50, 0, 0), (-50, 0, 0), (0, 0, 50)])
    assert nearest_views(copies, np.array([0, 0, 0, 1.0]), np.arange(4)).tolist() == [0, 6, 2, 4]


@pytest.mark.parametrize("fan", [FAN, NEAR], ids=["orthographic", "perspective"])
def test_seen_by_its_own_camera_a_quad_lies_on_the_views_picture(fan):
    """Whatever plane the quad lies in, a surface point of it is drawn on the line of sight of that very point."""
    yaw, scale, position = 0.9, 1.7, np.array([3.0, -1, 2])
    copies = Instances(fan, position, yaw, scale)
    view = fan.views[3]
    turn = rotation_about_y(yaw)
    if np.isinf(view.distance):
        eye = np.append(turn @ view.basis[2], 0)
    else:
        eye = np.append(position + scale * turn @ (view.center + view.distance * view.basis[2]), 1)
    quad = quads_toward(copies, eye)
    assert quad.view.tolist() == [3]
    model = view.center + np.random.default_rng(0).uniform(-0.7, 0.7, (20, 3))
    world = position + scale * model @ turn.T
    x, y, _ = view.project(model).T
    drawn = quad.center + x[:, None] * quad.right + y[:, None] * quad.up
    sight = eye[:3] - eye[3] * world
    np.testing.assert_allclose(np.cross(drawn - world, sight), 0, atol=1e-9)


def test_a_point_of_the_views_plane_is_drawn_where_it_is():
    view, (offset, slope_right, slope_up) = FAN.views[0], FAN.views.plane[0]
    quad = quads_toward(Instances(FAN, (1, 2, 3), 0.4, 2.0), np.append(direction(0.4, 0.2), 0))
    x, y = 0.3, -0.6
    model = view.unproject([x, y, offset + slope_right * x + slope_up * y])
    expected = np.array([1, 2, 3]) + 2.0 * rotation_about_y(0.4) @ model
    np.testing.assert_allclose(quad.center[0] + x * quad.right[0] + y * quad.up[0], expected)


@pytest.mark.parametrize("fan", [FAN, NEAR], ids=["orthographic", "perspective"])
def test_what_is_beside_the_picture_is_left_out_and_nothing_else(fan):
    random = np.random.default_rng(0)
    copies = Instances(
        fan, random.uniform(-30, 30, (4000, 3)), random.uniform(0, 7, 4000), random.uniform(0.2, 3, 4000)
    )
    viewer = Viewer.from_matrices(*Camera.perspective((2, 3, 9), (0, 1, 0), 40, 1.5, 1, 25).matrices, (0, 0, 90, 60))
    every, seen = quads_toward(copies, viewer.eye), quads_toward(copies, viewer.eye, viewer)
    corners = every.center[:, None] + fan.views.radius[0] * np.stack(
        [x * every.right + y * every.up for x in (-1, 1) for y in (-1, 1)], axis=1
    )
    clip = corners @ viewer.clip_from_world[:, :3].T + viewer.clip_from_world[:, 3]
    inside = (np.abs(clip[..., :2]) < clip[..., 3:]).all(axis=-1) & (clip[..., 2] > -clip[..., 3])
    inside = inside.any(axis=1)
    assert 50 < inside.sum() <= len(seen) < 1000
    assert set(np.flatnonzero(inside)) <= set(seen.index)
    chosen = every.take(seen.index)
    for name in ("index", "view", "basis", "origin", "center", "right", "up", "back", "middle", "scale"):
        np.testing.assert_array_equal(getattr(seen, name), getattr(chosen, name))


def test_some_quads_by_mask_are_those_by_index():
    quads = quads_toward(Instances(FAN, np.arange(12.0).reshape(4, 3)), np.array([0, 0, 1.0, 0]))
    mask = np.array([True, False, True, False])
    for some in (quads.take(mask), quads.take(np.flatnonzero(mask))):
        assert (some.index.tolist(), some.basis.shape) == ([0, 2], (2, 3, 3))
        np.testing.assert_array_equal(some.center, quads.center[mask])


@pytest.mark.parametrize("name", ["positions", "yaws", "scales"])
def test_what_is_written_into_an_array_shows_at_once_and_only_that_places_copies_anew(name):
    copies, eye = Instances(FAN, np.arange(12.0).reshape(4, 3)), np.array([0, 0, 1.0, 0])
    before, placement = quads_toward(copies, eye), copies.placement
    copies.visible[0], copies.shares[1] = False, 0.5
    assert copies.placement is placement
    getattr(copies, name)[2] += 1.5
    after = quads_toward(copies, eye)
    assert copies.placement is not placement
    apart = np.abs(np.stack([after.center, after.right]) - np.stack([before.center, before.right])[:, 1:])
    assert (apart.max(axis=(0, 2)) > 0.1).tolist() == [False, True, False]


def test_invisible_copies_show_nothing():
    copies = Instances(FAN, np.zeros((4, 3)))
    copies.visible[[0, 2]] = False
    assert quads_toward(copies, np.array([0, 0, 1.0, 0])).index.tolist() == [1, 3]
