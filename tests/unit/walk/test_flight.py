"""What the benchmarks say of a flight: a frame drawn with its switches held back, and the parts of a frame's time."""

import numpy as np
import pytest

from benchmarks.flight import Flight, blocks, means
from benchmarks.passes import PARTS, parts_timed
from impostor.files.fan_file import write_fan
from impostor.files.scene_file import load_scene
from runtime.walk.walk import Walk
from tests.solids import RED, Box, solid_fan

SCENE = """
[camera]
eye = [0, 4]
target = [0, 1, 0]
[[camera.path]]
time = 0
eye = [2.5, 1, 3.4]
target = [0, 1, 0]
[[camera.path]]
time = 1
eye = [3.4, 1, 2.5]
target = [0, 1, 0]
[sun]
time_of_day = 12
[ground]
albedo = [0.3, 0.3, 0.3]
[[instance]]
fan = "box.fan"
"""


@pytest.fixture
def scene(tmp_path):
    """A box past whose corner, where its view switches, the camera goes within a second; the sun stands still."""
    write_fan(tmp_path / "box.fan", solid_fan(Box((-0.9, 0, -0.3), (0.9, 2, 0.3), RED), views=4, size=64))
    (tmp_path / "scene.toml").write_text(SCENE)
    return load_scene(tmp_path / "scene.toml")


def test_only_the_frame_in_which_a_view_switches_pops(ctx, scene):
    flight = Flight(ctx, scene, view_fade_seconds=0)
    frames = [frame for frame, *_ in flight.frames(29)]
    (switching,) = [number for number, frame in enumerate(frames) if frame.switches["views"]]
    pops = [frame.pop.max() for frame in frames]
    assert pops.pop(switching) > 20 and max(pops) == 0
    assert len(frames[switching].copies) == 1 and frames[switching].copies[0, 0] > 0
    assert all(frame.motion.max() > 0 for frame in frames)
    flight.release()


def test_a_crossfade_spreads_the_pop_over_its_frames(ctx, scene):
    hard, soft = (Flight(ctx, scene, view_fade_seconds=seconds) for seconds in (0.0, 0.2))
    at_once, spread = ([frame.pop.max() for frame, *_ in flight.frames(29)] for flight in (hard, soft))
    assert 5 <= np.count_nonzero(spread) <= 7
    assert max(spread) < max(at_once) / 2
    for flight in (hard, soft):
        flight.release()


def test_a_kind_that_is_not_held_back_does_not_pop(ctx, scene):
    flight = Flight(ctx, scene)
    pops = [frame.pop.max() for frame, *_ in flight.frames(29, ("tiles",))]
    assert max(pops) == 0
    flight.release()


def test_means_of_blocks_and_of_rectangles():
    values = np.zeros((32, 48))
    values[16:, 32:] = 4
    assert blocks(values).tolist() == [[0, 0, 0], [0, 0, 4]]
    np.testing.assert_allclose(means(values, np.array([[32, 16, 48, 32], [16, 16, 48, 32], [0, 0, 4, 4]])), [4, 2, 0])


def test_the_parts_of_a_frame_are_counted_once(ctx, scene):
    walk = Walk(ctx, scene, (64, 64))
    walk.draw()
    walk.step(0.1)
    before = {name: vars(owner)[name] for _, calls in PARTS.values() for owner, name in calls}
    with parts_timed(ctx) as clock:
        walk.walker.eye[0] += 0.5
        walk.draw()
    assert {name: vars(owner)[name] for _, calls in PARTS.values() for owner, name in calls} == before
    assert {"choice", "tiles", "quads", "ground", "marks", "darken", "clear"} <= clock.seconds.keys()
    assert all(seconds >= 0 for seconds in clock.seconds.values())
    walk.release()
