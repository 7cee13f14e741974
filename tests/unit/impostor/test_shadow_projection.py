"""The five steps from a silhouette to the ground, against geometry worked out without them."""

import numpy as np
import pytest
from skimage.draw import polygon

from impostor.errors import SettingsError
from impostor.shadow_projection import (
    LOWEST_LIGHT,
    Ground,
    Quad,
    along_light,
    casts_shadow,
    plane_from_world,
    shadow_on_ground,
    strip_points,
    viewer_ground_from_ground,
)
from impostor.strips import silhouette_strips
from impostor.views import View, basis_facing, direction, frame, ring_bases, rotation_about_y

LEVEL = Ground(np.array([0.0, 1.0, 0.0]))
SLOPE = Ground(np.array([0.2, 1.0, -0.1]), -0.3)


def placed(position, yaw, scale):
    matrix = np.eye(4)
    matrix[:3, :3] = scale * rotation_about_y(yaw)
    matrix[:3, 3] = position
    return matrix


PLACED = placed((3.0, 0.5, -2.0), 0.7, 1.8)


def view_from(azimuth, elevation, distance=np.inf):
    basis = basis_facing(direction(azimuth, elevation))
    return View(basis, np.array([0.1, 0.9, -0.2]), 1.4, (-1.3, 1.2), distance)


def eye_of(view, world_from_model):
    """The view's own camera, as a viewer in the world."""
    back = view.basis[2]
    if np.isinf(view.distance):
        return world_from_model @ np.append(back, 0)
    return world_from_model @ np.append(view.center + view.distance * back, 1)


def turned(view, world_from_model, eye):
    """The view's quad, turned to face another viewer."""
    flat = Quad.unturned(view, world_from_model)
    right, up, _ = basis_facing(eye[:3] - eye[3] * flat.center) * np.linalg.norm(flat.right)
    return Quad(flat.center, right, up)


def homogeneous(points):
    return np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1)


def divided(points):
    return points[..., :-1] / points[..., -1:]


def screen(points, eye, target):
    """Where homogeneous points appear to a viewer: the tangents of their angles, or metres when it is orthographic."""
    back = eye[:3] - eye[3] * target
    rows = np.zeros((3, 4))
    rows[:, :3] = basis_facing(back)
    rows[:, 3] = -rows[:, :3] @ eye[:3] if eye[3] else 0
    x, y, z = rows @ points.T
    return np.stack([x, y]) / (-z if eye[3] else points[:, 3])


def ground_points(ground, count=50, reach=4.0):
    points = np.random.default_rng(0).uniform(-reach, reach, (count, 3))
    return points - (points @ ground.normal - ground.offset)[:, None] * ground.normal


@pytest.mark.parametrize("distance", [np.inf, 6.0])
def test_a_strip_point_is_the_surface_point_its_pixel_shows(distance):
    view = view_from(0.4, 0.2, distance)
    model = np.random.default_rng(1).uniform(-0.8, 0.8, (40, 3)) + view.center
    size = 64
    silhouette = np.zeros((size, size), bool)
    depth = np.zeros((size, size), np.uint16)
    clip = divided(homogeneous(model) @ view.clip_from_model().T)
    column, row = ((clip[:, 0] + 1) / 2 * size).astype(int), ((1 - clip[:, 1]) / 2 * size).astype(int)
    silhouette[row, column] = True
    low, high = view.depth_range
    depth[row, column] = np.round((view.project(model)[:, 2] - low) / (high - low) * 65535)
    strips = silhouette_strips(silhouette)
    points = strip_points(strips, view, depth)
    nearest = np.linalg.norm(points[:, None] - model, axis=2).min(axis=1)
    # From a pixel's centre to its corner, and again where a thin pixel's vertex is at its corner.
    assert nearest.max() < 2 * view.radius / size * np.sqrt(2) * 1.2


def test_points_go_along_the_light_to_the_ground():
    points = np.random.default_rng(2).uniform(0.5, 3, (20, 3))
    light = direction(1.0, 0.6)
    shadow = along_light(points, 3 * light, SLOPE)
    np.testing.assert_allclose(shadow @ SLOPE.normal, SLOPE.offset, atol=1e-12)
    np.testing.assert_allclose(np.cross(points - shadow, light), 0, atol=1e-12)


def test_an_edge_that_enters_the_ground_casts_a_straight_line_through_where_it_does():
    above, entry, buried = along_light([[0.0, 1, 0], [1, 0, 0], [3, -2, 0]], direction(0.3, 0.2), LEVEL)
    np.testing.assert_allclose(entry, [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(buried - entry, 2 * (entry - above), atol=1e-12)


@pytest.mark.parametrize(
    ("elevation_deg", "expected"), [(90, True), (1, True), (0.01, False), (0, False), (-30, False)]
)
def test_a_light_at_the_horizon_or_under_it_casts_no_shadow(elevation_deg, expected):
    assert casts_shadow(5 * direction(2.0, np.radians(elevation_deg)), LEVEL) is expected
    assert np.degrees(np.arcsin(LOWEST_LIGHT)) == pytest.approx(0.0573, abs=1e-4)


@pytest.mark.parametrize("distance", [np.inf, 6.0])
def test_the_plane_of_the_viewer_image_is_in_the_views_metres(distance):
    view = view_from(2.0, 0.3, distance)
    model = np.random.default_rng(3).uniform(-2, 2, (30, 3))
    world = homogeneous(model) @ PLACED.T
    np.testing.assert_allclose(
        divided(world @ plane_from_world(view, PLACED).T), view.project(model)[:, :2], rtol=1e-12, atol=1e-12
    )


@pytest.mark.parametrize("ground", [LEVEL, SLOPE], ids=["level", "slope"])
@pytest.mark.parametrize("distance", [np.inf, 6.0])
def test_seen_by_its_own_camera_the_shadow_stays_where_it_is(distance, ground):
    view = view_from(-0.8, 0.26, distance)
    eye = eye_of(view, PLACED)
    matrix = viewer_ground_from_ground(view, PLACED, Quad.unturned(view, PLACED), eye, ground)
    # Far enough to lie behind the perspective camera, too.
    points = ground_points(ground, reach=40)
    result = homogeneous(points) @ matrix.T
    assert (result[:, 3] > 0).all()
    np.testing.assert_allclose(divided(result), points, atol=1e-9)


@pytest.mark.parametrize("distance", [np.inf, 6.0])
def test_a_camera_level_with_the_ground_leaves_the_true_shadow(distance):
    ground = Ground(np.array([0.0, 1.0, 0.0]), 0.0)
    view = view_from(-0.8, 0.0, distance)
    eye = np.array([3.0, 0.4, 5.0, 1.0])
    matrix = viewer_ground_from_ground(view, PLACED, Quad.unturned(view, PLACED), eye, ground)
    points = ground_points(ground)
    np.testing.assert_allclose(divided(homogeneous(points) @ matrix.T), points, atol=1e-9)


@pytest.mark.parametrize("turn", [True, False], ids=["turned", "unturned"])
@pytest.mark.parametrize("perspective_viewer", [True, False])
@pytest.mark.parametrize("distance", [np.inf, 6.0])
def test_the_shadow_meets_the_feet_as_they_are_drawn(distance, perspective_viewer, turn):
    """A viewer between two fan cameras sees a point on the ground and its shadow in one place."""
    view = view_from(0.3, 0.26, distance)
    feet = homogeneous(ground_points(LEVEL, reach=1.0)) + np.append(PLACED[:3, 3] * (1, 0, 1), 0)
    toward = PLACED[:3, :3] @ direction(0.3 + 0.03, 0.4) / 1.8
    target = (PLACED @ np.append(view.center, 1))[:3]
    eye = np.append(target + 9 * toward, 1) if perspective_viewer else np.append(toward, 0)
    quad = turned(view, PLACED, eye) if turn else Quad.unturned(view, PLACED)

    model = divided(feet @ np.linalg.inv(PLACED).T)
    x, y = view.project(model)[:, :2].T
    drawn = homogeneous(quad.center + x[:, None] * quad.right + y[:, None] * quad.up)

    shadow = along_light(feet[:, :3], direction(2.0, 0.5), LEVEL)
    shadow = homogeneous(shadow) @ viewer_ground_from_ground(view, PLACED, quad, eye, LEVEL).T
    np.testing.assert_allclose(shadow @ LEVEL.plane, 0, atol=1e-9)
    np.testing.assert_allclose(screen(shadow, eye, target), screen(drawn, eye, target), atol=1e-9)


def test_a_shadow_beyond_the_horizon_has_a_negative_weight():
    """The viewer looks slightly down on a quad that reaches above the horizon."""
    view = view_from(0.0, 0.26)
    quad = Quad.unturned(view, np.eye(4))
    eye = np.array([0.0, 1.0, 8.0, 1.0])
    near, far = view.unproject(np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]))
    matrix = viewer_ground_from_ground(view, np.eye(4), quad, eye, LEVEL)
    result = np.stack([near, far]) @ matrix[:, :3].T + matrix[:, 3]
    assert result[0, 3] > 0 > result[1, 3]
    assert divided(result[:1])[0, 2] < eye[2]


# A frame on the ground, a thin post beside it, a sphere on it and another afloat.
BOXES = [
    ((-0.6, 0.0, -0.15), (-0.4, 1.0, 0.15)),
    ((0.4, 0.0, -0.15), (0.6, 1.0, 0.15)),
    ((-0.6, 0.9, -0.15), (0.6, 1.1, 0.15)),
    ((-0.6, 0.0, -0.15), (0.6, 0.1, 0.15)),
    ((-0.9, 0.0, -0.9), (-0.86, 0.8, -0.86)),
]
SPHERES = [((0.0, 1.3, 0.0), 0.35), ((0.7, 0.25, 0.5), 0.25)]


def first_hit(origin, toward):
    """Distance (...) from origins (..., 3) along one direction to the object; infinite past it."""
    near = np.full(origin.shape[:-1], np.inf)
    for center, radius in SPHERES:
        along = (origin - center) @ toward
        under = along**2 - ((origin - center) ** 2).sum(axis=-1) + radius**2
        near = np.where(under >= 0, np.minimum(near, -along - np.sqrt(np.maximum(under, 0))), near)
    for low, high in BOXES:
        a, b = (low - origin) / toward, (high - origin) / toward
        enter, leave = np.minimum(a, b).max(axis=-1), np.maximum(a, b).min(axis=-1)
        near = np.where(enter <= leave, np.minimum(near, enter), near)
    return near


def capture(view, size):
    """Silhouette and depth of the object, by one ray through each pixel's centre."""
    grid = ((np.arange(size) + 0.5) / size * 2 - 1) * view.radius
    xyz = np.stack(np.broadcast_arrays(grid, -grid[:, None], 10.0), axis=-1)
    z = 10 - first_hit(view.unproject(xyz), -view.basis[2])
    low, high = view.depth_range
    silhouette = np.isfinite(z)
    return silhouette, np.round(np.where(silhouette, (z - low) / (high - low), 0) * 65535).astype(np.uint16)


@pytest.mark.parametrize(
    ("views_off", "elevation_off_deg", "floor"),
    [(0, 0, 0.96), (0.5, 0, 0.94), (0, 10, 0.94), (0, 20, 0.90), (0.5, 20, 0.89)],
)
def test_the_shadow_is_the_one_that_rays_cast(views_off, elevation_off_deg, floor):
    """Intersection over union with a ray-cast shadow; half a pixel is lost all around by construction."""
    corners = np.concatenate([*BOXES, *([np.array(c) - r, np.array(c) + r] for c, r in SPHERES)]).astype(float)
    views = frame(ring_bases(96, np.radians(15)), corners, 256)
    light = direction((22 + views_off) * 2 * np.pi / 96, np.radians(15 + elevation_off_deg))
    view = views[int(views.nearest(light))]
    silhouette, depth = capture(view, 256)
    strips = silhouette_strips(silhouette)
    shadow = shadow_on_ground(
        strips,
        view,
        depth,
        view,
        Quad.unturned(view, np.eye(4)),
        world_from_model=np.eye(4),
        toward_light=light,
        eye=eye_of(view, np.eye(4)),
        ground=LEVEL,
        feet=0.25,
    )
    floor_points = divided(shadow)[:, [0, 2]]
    low, high, size = floor_points.min(axis=0) - 0.1, floor_points.max(axis=0) + 0.1, 400
    x, z = low[:, None] + (np.arange(size) + 0.5) / size * (high - low)[:, None]
    true = np.isfinite(first_hit(np.stack(np.broadcast_arrays(x, 0.0, z[:, None]), axis=-1), light))
    found = np.zeros((size, size), bool)
    cells = (floor_points - low) / (high - low) * size - 0.5
    for triangle in cells[strips.triangles()]:
        found[polygon(triangle[:, 1], triangle[:, 0], found.shape)] = True
    assert (found & true).sum() / (found | true).sum() > floor


@pytest.mark.parametrize(("light_elevation", "eye"), [(-0.2, (0, 3, 9, 1)), (0.5, (0, -1, 9, 1)), (0.5, (0, 0, 1, 0))])
def test_no_light_on_the_ground_or_no_sight_of_it_is_no_shadow(light_elevation, eye):
    view = view_from(0.0, 0.3)
    silhouette = np.ones((8, 8), bool)
    shadow = shadow_on_ground(
        silhouette_strips(silhouette),
        view,
        np.zeros((8, 8), np.uint16),
        view,
        Quad.unturned(view, PLACED),
        world_from_model=PLACED,
        toward_light=direction(1.0, light_elevation),
        eye=eye,
        ground=LEVEL,
        feet=0.25,
    )
    assert shadow.shape == (0, 4)


def test_the_ground_keeps_its_place_whatever_the_normals_length():
    ground = Ground(np.array([0.0, 4.0, 0.0]), 8.0)
    assert ground.plane @ [5, 2, 7, 1] == 0
    with pytest.raises(SettingsError, match="ground normal"):
        Ground(np.zeros(3))
