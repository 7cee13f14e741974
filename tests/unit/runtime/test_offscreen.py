"""Pictures without a window."""

import numpy as np
import pytest
from PIL import Image

from impostor.errors import GpuError, OutputError, SettingsError
from impostor.files.pictures import save_png
from impostor.shadow_projection import Ground
from runtime.gl.offscreen import Offscreen
from runtime.ground.ground_pass import GroundSurface
from runtime.viewing.cameras import Camera

LEVEL = Ground((0, 1, 0), 0.0)


@pytest.fixture
def offscreen(ctx):
    """Makes framebuffers that the test need not release."""
    made = []

    def make(*arguments):
        made.append(Offscreen(ctx, *arguments))
        return made[-1]

    yield make
    for each in made:
        each.release()


@pytest.mark.parametrize("samples", [1, 2, 8])
def test_a_cleared_picture_is_the_background(offscreen, samples):
    picture = offscreen(5, 3, samples)
    picture.clear((0.2, 0.4, 0.6, 1.0))
    pixels = picture.color()
    assert pixels.shape == (3, 5, 4)
    assert pixels.dtype == np.uint8
    assert (pixels == (51, 102, 153, 255)).all()
    assert (picture.depth() == 1).all()
    assert picture.depth().shape == (3, 5)


def horizon(renderer, picture, elevation):
    """White ground below a black sky."""
    renderer.lights, renderer.ambient = [], 1.0
    picture.clear((0, 0, 0, 1))
    camera = Camera.perspective((0, 1, 0), (0, 1 + np.tan(elevation), -1), 60, 1, 0.1, 1e4)
    surface = GroundSurface(albedo=(1, 1, 1), reach=1e4)
    renderer.draw_ground(camera.clip_from_view, camera.view_from_world, LEVEL, surface)


def test_row_0_is_the_top_in_colour_and_depth(renderer, offscreen):
    picture = offscreen(16, 16)
    horizon(renderer, picture, 0.0)
    assert (picture.color()[0, :, 0] == 0).all()
    assert (picture.color()[-1, :, 0] == 255).all()
    assert picture.depth()[0, 8] == 1 > picture.depth()[-1, 8]


def test_samples_make_the_mean_of_their_pixels(renderer, offscreen):
    """The horizon a third of a pixel above the middle: one of three pixel rows of samples is ground there."""
    coarse, fine = offscreen(16, 16, 4), offscreen(64, 64, 1)
    for picture in (coarse, fine):
        horizon(renderer, picture, -0.02)
    pixels = fine.color().reshape(16, 4, 16, 4, 4)
    np.testing.assert_allclose(coarse.color(), pixels.mean(axis=(1, 3)), atol=2)
    assert len(np.unique(coarse.color()[:, 8, 0])) == 3
    np.testing.assert_array_equal(coarse.depth(), fine.depth().reshape(16, 4, 16, 4).min(axis=(1, 3)))


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ((8, 8, 3), SettingsError, "samples: 3; expected 1, 2, 4 or 8"),
        ((0, 8), SettingsError, "picture: 0x8 pixels"),
        ((100_000, 8), GpuError, "picture: needs a texture of 100000x8; this GPU holds at most"),
        ((20_000, 8, 8), GpuError, "picture: needs a texture of 160000x64"),
    ],
)
def test_impossible_pictures_are_refused(ctx, arguments, error, message):
    with pytest.raises(error) as caught:
        Offscreen(ctx, *arguments)
    assert str(caught.value).startswith(message)


def test_drawing_goes_on_elsewhere_after_a_release(ctx, renderer, offscreen):
    first, second = Offscreen(ctx, 8, 8), offscreen(8, 8)
    first.clear()
    first.release()
    second.clear((1, 0, 0, 1))
    horizon(renderer, second, 0.0)
    assert (second.color()[-1, :, 1] == 255).all()


@pytest.mark.parametrize("shape", [(4, 6), (4, 6, 3), (4, 6, 4)])
def test_a_png_holds_what_was_saved(tmp_path, shape):
    pixels = np.random.default_rng(0).integers(0, 256, shape, np.uint8)
    save_png(tmp_path / "a.png", pixels[::-1])
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "a.png")), pixels[::-1])


def test_a_png_replaces_another_only_by_force(tmp_path):
    path = tmp_path / "a.png"
    save_png(path, np.zeros((2, 2), np.uint8))
    with pytest.raises(OutputError, match=r"a\.png"):
        save_png(path, np.ones((2, 2), np.uint8))
    save_png(path, np.ones((2, 2), np.uint8), force=True)
    assert np.asarray(Image.open(path)).all()
