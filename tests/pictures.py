"""What picture tests share: cameras on the unit scene, masks, and how alike they are."""

import numpy as np

from impostor.views import rotation_about_y
from runtime.gl.offscreen import Offscreen
from runtime.viewing.cameras import Camera


def filling(half=1.0, azimuth=0.0, elevation=0.0, center=(0.0, 0.0, 0.0)):
    """Matrices of an orthographic camera whose picture is 2 `half` metres wide."""
    return Camera.orthographic(center, half / 1.02, azimuth, elevation).matrices


def looking(eye, target=(0.0, 0.0, 0.0), fov_deg=45.0, near=0.1, far=100.0):
    """Matrices of a square perspective picture."""
    return Camera.perspective(eye, target, fov_deg, 1.0, near, far).matrices


def placed(position=(0.0, 0.0, 0.0), yaw=0.0, scale=1.0):
    """`world_from_model` of an instance."""
    matrix = np.eye(4)
    matrix[:3, :3] = scale * rotation_about_y(yaw)
    matrix[:3, 3] = position
    return matrix


def cropped(clip_from_view, column, row, parts):
    """The projection that shows one of `parts` x `parts` tiles of a picture, row 0 at the top."""
    crop = np.diag([parts, parts, 1.0, 1.0])
    crop[0, 3], crop[1, 3] = parts - 1 - 2 * column, -(parts - 1 - 2 * row)
    return crop @ clip_from_view


def mesh_picture(renderer, screen, model, matrices=None, output="lit", place=None, **options):
    """One mesh by itself; the camera fills the picture with the unit square if not given, `options` as `add_mesh`."""
    mesh = renderer.add_mesh(model, place, **options)
    screen.clear()
    renderer.draw_meshes(*(matrices or filling()), output=output)
    renderer.remove(mesh)
    return screen.color()


def assert_parts_are_the_whole(ctx, screen, draw, matrices):
    """A picture is what 4 x 4 pictures of its parts show, each culled for itself; `screen` is 64 x 64."""
    whole = Offscreen(ctx, 256, 256)
    whole.clear()
    draw(*matrices, output="albedo")
    expected = whole.color()
    whole.release()
    for row in range(4):
        for column in range(4):
            screen.clear()
            draw(cropped(matrices[0], column, row, 4), matrices[1], output="albedo")
            part = expected[64 * row : 64 * row + 64, 64 * column : 64 * column + 64]
            assert (apart(screen.color(), part) > 4).sum() < 6, (row, column)


def iou(found, expected):
    """Intersection over union of two masks."""
    return np.count_nonzero(found & expected) / np.count_nonzero(found | expected)


def apart(found, expected):
    """Largest channel difference of each pixel, int."""
    return np.abs(np.asarray(found, int) - np.asarray(expected, int)).max(axis=-1)


def bluish(pixels):
    """Where blue is the strongest channel."""
    return (pixels[..., 2] > pixels[..., 0]) & (pixels[..., 2] > pixels[..., 1])


def greenish(pixels):
    """Where green is the strongest channel."""
    return (pixels[..., 1] > pixels[..., 0]) & (pixels[..., 1] > pixels[..., 2])
