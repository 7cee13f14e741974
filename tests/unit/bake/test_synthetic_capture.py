"""Synthetic photographs: light, shadow and bounce where physics puts them."""

import numpy as np
import pytest

from bake.reliefs import relief_of_model, relief_of_picture, write_capture
from bake.synthetic_capture import Relief, form_factors, photograph, visibility
from impostor.errors import OutputError, SettingsError
from impostor.files.lp_file import read_lp
from impostor.model import load_model
from tests.captures import write_photographs
from tests.end_to_end.commands import SQUARE, SQUARE_FACES, write_obj

HIGH = (0, 0, 1)


def even(heights, albedo=0.8):
    return Relief(heights, np.full((*heights.shape, 3), albedo))


def groove(length=96, width=64):
    """Two slopes of 45 degrees that meet in a valley along the columns' middle."""
    return np.tile(np.abs(np.arange(width) - (width - 1) / 2), (length, 1))


def received(relief):
    """What each texel gets of a surface that is white all over, (H * W,)."""
    return np.concatenate([np.asarray(band.sum(axis=1)).ravel() for band in form_factors(relief)])


@pytest.mark.parametrize("light", [(0, 0, 1), (0.6, 0, 0.8), (0, -0.8, 0.6)])
def test_a_plain_surface_is_lamberts(light):
    found = photograph(even(np.zeros((8, 9))), [light])
    np.testing.assert_allclose(found, 0.8 * light[2], rtol=1e-6)


@pytest.mark.parametrize(
    ("light", "dark", "lit"),
    [
        ((-0.8, 0, 0.6), (20, 24), (20, 16)),
        ((0.8, 0, 0.6), (20, 16), (20, 24)),
        ((0, 0.8, 0.6), (24, 20), (16, 20)),
        ((0, -0.8, 0.6), (16, 20), (24, 20)),
    ],
)
def test_a_post_casts_its_shadow_away_from_the_light(light, dark, lit):
    heights = np.zeros((41, 41))
    heights[19:22, 19:22] = 6
    seen = visibility(heights, light)
    assert (seen[dark], seen[lit]) == (0, 1)


def test_a_shadow_is_as_long_as_the_light_is_low():
    heights = np.zeros((10, 60))
    heights[:, 10] = 6
    for elevation_deg in (25, 45, 60):
        elevation = np.radians(elevation_deg)
        seen = visibility(heights, (-np.cos(elevation), 0, np.sin(elevation)))
        length = np.sum(1 - seen[5, 11:])
        assert length == pytest.approx(6 / np.tan(elevation), abs=1)


def test_a_v_groove_is_brighter_by_its_bounce():
    relief = even(groove())
    direct, with_bounce = (photograph(relief, [HIGH], bounce=choice)[0, 48, :, 0] for choice in (False, True))
    assert (with_bounce >= direct).all()
    assert with_bounce[31] > 1.2 * direct[31]
    gain = with_bounce - direct
    assert gain[31] > gain[10] > gain[2]


def test_a_right_angled_groove_sees_itself_as_hottel_says():
    # Hottel's crossed strings: one wall of an endless right-angled groove sees 1 - sin 45 degrees of the other.
    shares = received(even(groove(length=200))).reshape(200, 64)[100]
    assert shares.mean() == pytest.approx(1 - np.sin(np.pi / 4), rel=0.06)


def test_a_plain_or_bulging_surface_receives_no_bounce():
    row, column = np.mgrid[-1:1:33j, -1:1:33j]
    for heights in (np.zeros((33, 33)), 8 * (1 - row**2 - column**2)):
        assert received(even(heights)).sum() < 0.02 * heights.size


def test_form_factors_take_no_more_memory_for_a_larger_picture():
    noise = np.random.default_rng(1)
    most = [max(band.nnz for band in form_factors(even(noise.random((128, width)) * 20))) for width in (128, 512)]
    assert most[1] < 1.2 * most[0]


def test_progress_counts_lights_and_bounces_to_the_end():
    steps = []
    photograph(even(groove(160, 160)), [HIGH, HIGH], progress=lambda done, total: steps.append((done, total)))
    assert steps == [(done, len(steps)) for done in range(1, len(steps) + 1)] and len(steps) > 3


def test_a_highlight_stands_where_the_surface_mirrors_the_light():
    column = np.tile(np.arange(101) - 50.0, (5, 1))
    dome = Relief(-(column**2) / 200, np.full((5, 101, 3), 0.1), gloss=1.0, shininess=400)
    light = np.array([0.6, 0, 0.8])
    half = (light + [0, 0, 1]) / np.linalg.norm(light + [0, 0, 1])
    brightest = np.argmax(photograph(dome, [light])[0, 2, :, 0]) - 50
    assert brightest == pytest.approx(100 * half[0] / half[2], abs=1.5)


def test_a_height_picture_is_read_with_its_colours(tmp_path):
    heights, colors = np.zeros((6, 8), np.uint16), np.zeros((6, 8, 3), np.uint8)
    heights[2:4, 3:5], colors[..., 0] = 65535, 255
    paths = write_photographs(tmp_path, [heights, colors])
    relief = relief_of_picture(paths[0], 12.5, paths[1])
    assert relief.heights[2, 3] == 12.5 and relief.heights[0, 0] == 0
    np.testing.assert_allclose(relief.albedo[0, 0], [1, 0, 0])


def test_a_mesh_is_seen_from_the_side_that_is_asked_for(tmp_path):
    # A roof of 45 degrees whose ridge runs along z, closed at its front.
    roof = [[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1], [0, 1, -1], [0, 1, 1]]
    faces = [[0, 4, 5], [0, 5, 3], [4, 1, 2], [4, 2, 5], [3, 5, 2]]
    model = load_model(write_obj(tmp_path / "roof.obj", roof, faces))
    top = relief_of_model(model, 40, "top")
    middle = top.heights[20]
    assert np.argmax(middle) in (19, 20)
    assert middle[19] - middle[10] == pytest.approx(9, rel=0.05)
    front = relief_of_model(model, 40, "front")
    assert (front.albedo[5, 2] == 0).all() and (front.albedo[28, 20] > 0).all()


def test_an_open_square_faces_the_camera_flat(tmp_path):
    relief = relief_of_model(load_model(write_obj(tmp_path / "square.obj", SQUARE, SQUARE_FACES)), 32)
    assert np.ptp(relief.heights) < 0.01


@pytest.mark.parametrize("quality", [None, 95])
def test_a_written_capture_set_reads_back(tmp_path, quality):
    lights = np.array([[0.6, 0, 0.8], [0, 0, 1.0]])
    write_capture([np.full((4, 5, 3), 0.2), np.full((4, 5, 3), 2.0)], lights, tmp_path / "a.lp", quality=quality)
    capture = read_lp(tmp_path / "a.lp")
    np.testing.assert_allclose(capture.directions, lights)
    assert [path.stem for path in capture.photographs] == ["a_0", "a_1"]
    with pytest.raises(OutputError, match="exists already"):
        write_capture([np.zeros((4, 5, 3))] * 2, lights, tmp_path / "a.lp", quality=quality)


@pytest.mark.parametrize("force", [False, True])
def test_a_capture_set_that_is_stopped_leaves_nothing_half_written(tmp_path, monkeypatch, force):
    pictures, lights = [np.full((4, 5, 3), 0.2)] * 2, np.array([[0.6, 0, 0.8], [0, 0, 1.0]])
    if force:
        write_capture(pictures, lights, tmp_path / "a.lp")

    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("bake.reliefs.write_lp", stop)
    with pytest.raises(KeyboardInterrupt):
        write_capture(pictures, lights, tmp_path / "a.lp", force=force)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("wrong", [{"lights": [(0, 0, -1)]}, {"albedo": 1.5}, {"heights": np.full((4, 4), np.inf)}])
def test_what_cannot_be_photographed_is_refused(wrong):
    with pytest.raises(SettingsError):
        photograph(even(wrong.get("heights", np.zeros((4, 4))), wrong.get("albedo", 0.5)), wrong.get("lights", [HIGH]))
