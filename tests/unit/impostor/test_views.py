"""Where a fan's cameras stand, what they frame, and which one is nearest."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impostor.errors import SettingsError
from impostor.views import (
    LAYOUTS,
    MAX_VIEWS,
    View,
    basis_facing,
    direction,
    frame,
    layout_bases,
    ring_bases,
    rotation_about_y,
)

POINTS = np.random.default_rng(5).normal(size=(300, 3)) * (0.3, 1.2, 0.6) + (4.0, -2.0, 1.0)
angles = st.floats(-10, 10)


def view(distance, plane=(0.0, 0.0, 0.0)):
    return View(basis_facing(direction(2.1, 0.4)), np.array([0.3, -1.0, 2.0]), 1.5, (-1.2, 0.9), distance, plane)


@pytest.mark.parametrize(
    ("azimuth_deg", "elevation_deg", "expected"),
    [(0, 0, (0, 0, 1)), (90, 0, (1, 0, 0)), (180, 0, (0, 0, -1)), (270, 0, (-1, 0, 0)), (33, 90, (0, 1, 0))],
)
def test_azimuth_turns_from_z_toward_x_and_elevation_rises(azimuth_deg, elevation_deg, expected):
    np.testing.assert_allclose(direction(np.radians(azimuth_deg), np.radians(elevation_deg)), expected, atol=1e-12)


def test_a_yaw_turns_a_model_as_azimuth_turns_a_camera():
    np.testing.assert_allclose(rotation_about_y(0.7) @ direction(0.2, 0.3), direction(0.9, 0.3), atol=1e-12)
    assert rotation_about_y(np.zeros((2, 5))).shape == (2, 5, 3, 3)


def test_view_0_of_a_ring_looks_from_z_and_the_next_stand_toward_x():
    backs = ring_bases(8, 0.0)[:, 2]
    np.testing.assert_allclose(backs[0], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(backs[2], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(ring_bases(6, 0.5)[:, 2, 1], np.sin(0.5))


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("count", [1, 2, 17, 96])
def test_bases_are_orthonormal_right_handed_and_level(layout, count):
    bases = layout_bases(layout, count, 0.3)
    np.testing.assert_allclose(bases @ bases.swapaxes(1, 2), np.broadcast_to(np.eye(3), bases.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(bases), 1)
    np.testing.assert_allclose(bases[:, 0, 1], 0, atol=1e-12)
    assert (bases[:, 1, 1] >= 0).all()


@pytest.mark.parametrize("side", [1, -1])
def test_a_camera_straight_above_or_below_takes_x_as_its_right(side):
    basis = basis_facing([0, 3.0 * side, 0])
    np.testing.assert_allclose(basis, [[1, 0, 0], [0, 0, -side], [0, side, 0]], atol=1e-12)


@pytest.mark.parametrize(("layout", "lowest"), [("hemisphere", 0), ("sphere", -1)])
def test_a_spiral_leaves_no_direction_far_from_a_camera(layout, lowest):
    backs = layout_bases(layout, 96, 0.0)[:, 2]
    assert (backs[:, 1] > lowest).all()
    asked = direction(*np.random.default_rng(0).uniform((-np.pi, np.arcsin(lowest)), (np.pi, np.pi / 2), (2000, 2)).T)
    # 96 caps that cover the (hemi)sphere without overlap would have this radius; twice that leaves no hole.
    cap = np.arccos(1 - (1 - lowest) / 96)
    assert np.arccos((asked @ backs.T).max(axis=1)).max() < 2 * cap


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(LAYOUTS), st.integers(1, 40), st.floats(-1.4, 1.4), angles, angles, st.floats(0.01, 100))
def test_the_nearest_view_has_the_smallest_angle(layout, count, ring, azimuth, elevation, length):
    views = frame(layout_bases(layout, count, ring), POINTS, 64)
    toward = direction(azimuth, elevation)
    found = int(views.nearest(length * toward))
    angle = [np.arccos(np.clip(camera.basis[2] @ toward, -1, 1)) for camera in views]
    assert angle[found] == pytest.approx(min(angle), abs=1e-6)


def test_the_nearest_views_of_many_directions_at_once():
    views = frame(ring_bases(4, 0.2), POINTS, 64)
    toward = direction(np.radians([[10, 80], [170, 260]]), 0.9)
    assert views.nearest(toward).tolist() == [[0, 1], [2, 3]]


@pytest.mark.parametrize("distance", [np.inf, 4.0])
def test_unproject_undoes_project(distance):
    points = np.random.default_rng(1).uniform(-1, 1, (7, 5, 3)) + (0.3, -1.0, 2.0)
    camera = view(distance)
    np.testing.assert_allclose(camera.unproject(camera.project(points)), points, atol=1e-12)


@pytest.mark.parametrize("distance", [np.inf, 4.0])
def test_clip_space_is_the_tile_and_the_depth_range(distance):
    camera = view(distance)
    corners = [[x, y, z] for x in (-1.5, 1.5) for y in (-1.5, 1.5) for z in (-1.2, 0.9)]
    clip = np.column_stack([camera.unproject(corners), np.ones(8)]) @ camera.clip_from_model().T
    expected = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (1, -1)]
    np.testing.assert_allclose(clip[:, :3] / clip[:, 3:], expected, atol=1e-12)
    assert (clip[:, 3] > 0).all()


def test_project_measures_metres_from_the_centre():
    camera = view(np.inf)
    right, up, back = camera.basis
    np.testing.assert_allclose(camera.project(camera.center + 0.2 * right - 0.5 * up + 3 * back), [0.2, -0.5, 3])
    near = view(4.0)
    np.testing.assert_allclose(near.project(near.center + 0.2 * right + 2 * back), [0.4, 0, 2], atol=1e-12)


@pytest.mark.parametrize("distance", [np.inf, 5.0])
@pytest.mark.parametrize("size", [16, 256])
def test_a_framed_object_fills_its_tiles(distance, size):
    views = frame(layout_bases("hemisphere", 9, 0.0), POINTS, size, distance, margin=2)
    assert len(set(views.radius.tolist())) == 1
    widest = 0.0
    for camera in views:
        xyz = camera.project(POINTS)
        texels = np.abs(xyz[:, :2]) / camera.radius * size / 2
        widest = max(widest, texels.max())
        low, high = camera.depth_range
        assert low < xyz[:, 2].min() < xyz[:, 2].max() < high
        assert high - low < 1.1 * np.ptp(xyz[:, 2])
    assert widest == pytest.approx(size / 2 - 2, abs=0.01)


def test_orthographic_views_are_centred_on_what_they_see():
    for camera in frame(ring_bases(5, 0.3), POINTS, 64):
        xyz = camera.project(POINTS)
        np.testing.assert_allclose(xyz.max(axis=0) + xyz.min(axis=0), 0, atol=1e-5)


def test_a_flat_object_has_room_in_depth():
    card = np.array([[-1, 0, 0], [1, 0, 0], [1, 2, 0], [-1, 2, 0]], float)
    low, high = frame(ring_bases(1, 0.0), card, 64).depth_range[0]
    assert low < 0 < high


def test_one_point_can_be_framed():
    views = frame(ring_bases(3, 0.0), np.array([[1.0, 2.0, 3.0]]), 64)
    assert np.isfinite(views.radius).all()
    assert (views.radius > 0).all()
    np.testing.assert_allclose(views.center, np.tile([1, 2, 3], (3, 1)), atol=1e-9)


def test_far_from_the_origin_the_frame_stays_tight():
    away = POINTS + (1e5, 0, -1e5)
    near, far = (frame(ring_bases(7, 0.2), points, 128) for points in (POINTS, away))
    np.testing.assert_allclose(far.radius, near.radius, rtol=1e-3)


def test_views_and_view_agree():
    views = frame(ring_bases(5, 0.3), POINTS, 64, 6.0)
    assert len(list(views)) == len(views) == 5
    np.testing.assert_array_equal(views[3].center, views.center[3])
    assert views[3].depth_range == tuple(views.depth_range[3])
    assert (views[3].distance, views[3].plane) == (6.0, (0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("layout", "count", "elevation", "message"),
    [
        ("ring", 0, 0.0, "views: 0 views; expected 1 to 2048"),
        ("sphere", MAX_VIEWS + 1, 0.0, "views: 2049 views"),
        ("ring", 8, np.pi / 2, "elevation: 90 degrees"),
        ("ring", 8, np.nan, "elevation: nan degrees"),
        ("disc", 8, 0.0, "layout: 'disc'; expected one of ring, hemisphere, sphere"),
    ],
)
def test_impossible_layouts_are_refused(layout, count, elevation, message):
    with pytest.raises(SettingsError) as caught:
        layout_bases(layout, count, elevation)
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize("distance", [0.5, 0.0, -3.0, np.nan])
def test_an_eye_inside_the_object_is_refused(distance):
    with pytest.raises(SettingsError, match=r"^distance: .* expected more than"):
        frame(ring_bases(4, 0.0), POINTS, 64, distance)
