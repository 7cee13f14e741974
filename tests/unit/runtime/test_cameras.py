"""Cameras, and what the passes read out of any caller's two matrices."""

import numpy as np
import pytest

from impostor.errors import SettingsError
from impostor.views import direction
from runtime.viewing.cameras import FRAME_MARGIN, Camera
from runtime.viewing.viewer import Viewer

VIEWPORT = (0, 0, 200, 100)


def clip(camera, point):
    """Normalised device coordinates (3,) of a world-space point, and its clip w."""
    x, y, z, w = camera.clip_from_view @ camera.view_from_world @ np.append(np.asarray(point, float), 1)
    return np.array([x, y, z]) / w, w


def viewer(camera, viewport=VIEWPORT):
    return Viewer.from_matrices(camera.clip_from_view, camera.view_from_world, viewport)


PERSPECTIVE = Camera.perspective((1, 2, 8), (1, 2, 0), fov_deg=90, aspect=2, near=2, far=50)
ORTHOGRAPHIC = Camera.orthographic((1, 2, 3), 2.0, azimuth=np.pi / 2, elevation=0.0)


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ((1, 2, 0), (0, 0)),
        ((1, 10, 0), (0, 1)),
        ((17, 2, 0), (1, 0)),
        ((-7, -2, 4), (-1, -1)),
    ],
)
def test_known_points_in_perspective(point, expected):
    found, w = clip(PERSPECTIVE, point)
    np.testing.assert_allclose(found[:2], expected, atol=1e-12)
    assert w == pytest.approx(8 - point[2])


def test_perspective_depth_runs_from_near_to_far():
    assert clip(PERSPECTIVE, (1, 2, 6))[0][2] == pytest.approx(-1)
    assert clip(PERSPECTIVE, (1, 2, -42))[0][2] == pytest.approx(1)


def test_an_orthographic_camera_at_azimuth_90_sees_z_at_its_left():
    """It stands toward +X: -Z is to its right, +Y up, and the sphere ends 2 percent inside the picture."""
    half = 2.0 * FRAME_MARGIN
    np.testing.assert_allclose(clip(ORTHOGRAPHIC, (1, 2, 3))[0], 0, atol=1e-12)
    np.testing.assert_allclose(clip(ORTHOGRAPHIC, (7, 2, 3 - half))[0][:2], (1, 0), atol=1e-12)
    np.testing.assert_allclose(clip(ORTHOGRAPHIC, (-5, 2 + half, 3))[0][:2], (0, 1), atol=1e-12)
    assert clip(ORTHOGRAPHIC, (3, 2, 3))[0][2] < clip(ORTHOGRAPHIC, (-1, 2, 3))[0][2]


@pytest.mark.parametrize("aspect", [0.5, 1, 3])
def test_the_sphere_fits_the_shorter_side(aspect):
    camera = Camera.orthographic((0, 0, 0), 1.0, 0.0, 0.0, aspect)
    right, up = clip(camera, (1, 0, 0))[0][0], clip(camera, (0, 1, 0))[0][1]
    assert max(right, up) == pytest.approx(1 / FRAME_MARGIN)
    assert up / right == pytest.approx(aspect)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((1, 1, 1), (1, 1, 1), 60, 1, 0.1, 10), "camera: eye and target are both"),
        (((0, 0, 1), (0, 0, 0), 0, 1, 0.1, 10), "fov_deg: 0 degrees"),
        (((0, 0, 1), (0, 0, 0), 180, 1, 0.1, 10), "fov_deg: 180 degrees"),
        (((0, 0, 1), (0, 0, 0), 60, 1, 0, 10), "camera: near 0 m"),
        (((0, 0, 1), (0, 0, 0), 60, 1, 10, 10), "camera: near 10 m, far 10 m"),
    ],
)
def test_impossible_cameras_are_refused(arguments, message):
    with pytest.raises(SettingsError) as caught:
        Camera.perspective(*arguments)
    assert str(caught.value).startswith(message)


def test_the_eye_of_a_perspective_camera_is_where_it_stands():
    np.testing.assert_allclose(viewer(PERSPECTIVE).eye, [1, 2, 8, 1], atol=1e-9)


def test_the_eye_of_a_camera_with_its_far_plane_at_infinity():
    matrix = PERSPECTIVE.clip_from_view.copy()
    matrix[2, 2:] = -1, -2 * 0.1
    found = Viewer.from_matrices(matrix, PERSPECTIVE.view_from_world, VIEWPORT).eye
    np.testing.assert_allclose(found, [1, 2, 8, 1], atol=1e-9)


@pytest.mark.parametrize(("azimuth", "elevation"), [(0, 0), (2.0, 0.5), (-1.0, -0.7), (0.3, np.pi / 2)])
def test_the_eye_of_an_orthographic_camera_is_a_direction(azimuth, elevation):
    camera = Camera.orthographic((5, 5, 5), 30.0, azimuth, elevation)
    np.testing.assert_allclose(viewer(camera).eye, [*direction(azimuth, elevation), 0], atol=1e-9)


def test_the_eye_far_from_the_origin_in_float64():
    camera = Camera.perspective((1e5, 2, 1e5 + 8), (1e5, 2, 1e5), 60, 1, 0.1, 1000)
    np.testing.assert_allclose(viewer(camera).eye, [1e5, 2, 1e5 + 8, 1], atol=1e-4)


def test_a_metre_on_screen():
    """90 degrees over 100 pixels: at 8 metres the picture is 16 metres high."""
    seen = viewer(PERSPECTIVE).pixels_per_metre(np.array([[1.0, 2, 0], [40, 2, 0], [1, 2, 4], [1, 2, 9]]))
    np.testing.assert_allclose(seen, [100 / 16, 100 / 16, 100 / 8, 0])
    seen = viewer(ORTHOGRAPHIC).pixels_per_metre(np.array([[1.0, 2, 3], [-100, 2, 3]]))
    np.testing.assert_allclose(seen, 50 / (2.0 * FRAME_MARGIN))


def test_spheres_that_touch_the_picture_are_seen():
    eye = viewer(PERSPECTIVE)
    points = np.array([[1.0, 2, 0], [1, 30, 0], [1, 30, 0], [1, 2, 20], [1, 2, 9], [1, 2, -500]])
    assert eye.sees(points, np.array([1.0, 1, 30, 1, 4, 1])).tolist() == [True, False, True, False, True, True]


@pytest.mark.parametrize(
    ("matrix", "problem"),
    [
        (np.eye(3), "of shape (3, 3); expected (4, 4)"),
        (np.full((4, 4), np.nan), "with a number that is not finite"),
        (np.diag([1.0, 0, 1, 1]), "@ view_from_world has no inverse"),
    ],
)
def test_matrices_that_are_no_camera_are_refused(matrix, problem):
    for pair in ((matrix, np.eye(4)), (np.eye(4), matrix)):
        with pytest.raises(SettingsError) as caught:
            Viewer.from_matrices(*pair, VIEWPORT)
        assert str(caught.value).startswith("camera: ") and problem in str(caught.value)
