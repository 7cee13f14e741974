"""Hot reload: what changed is told, and a file that is wrong for a moment breaks nothing."""

import os

import pytest

from impostor.errors import SceneFileError
from impostor.files.scene_watcher import SceneWatcher
from tests.scene_files import CAMERA, fill

SCENE = f"""{CAMERA}
[ground]
texture = "a.png"
[[light]]
azimuth_deg = 0
elevation_deg = 40
[[scatter]]
model = "deep/c.obj"
count = 20
circle = [0, 0, 9]
seed = 1
[[instance]]
fan = "a.fan"
[[surface]]
ptm = "a.ptm"
width = 1
height = 1
"""


@pytest.fixture
def folder(tmp_path):
    return fill(tmp_path)


@pytest.fixture
def watcher(folder):
    (folder / "s.toml").write_text(SCENE)
    return SceneWatcher(folder / "s.toml")


def rewrite(folder, old, new):
    text = (folder / "s.toml").read_text()
    assert old in text
    (folder / "s.toml").write_text(text.replace(old, new))


def test_nothing_is_read_while_nothing_changes(watcher, monkeypatch):
    monkeypatch.setattr("impostor.files.scene_watcher.read_scene", lambda _: pytest.fail("was read"))
    scene = watcher.scene
    assert [watcher.poll() for _ in range(3)] == [None] * 3
    assert watcher.scene is scene and watcher.message == ""


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ("elevation_deg = 40", "elevation_deg = 41", {"lights"}),
        ("seed = 1", "seed = 2", {"instances"}),
        ("eye = [0, 1, 5]", "eye = [0, 1, 6]", {"camera"}),
        ("[ground]", "[ground]\nheight = 1", {"ground", "instances", "surfaces"}),
        ("width = 1", "width = 2", {"surfaces"}),
        ("[ground]", "[sun]\n[ground]", {"sun", "ambient"}),
        ("[camera]", "background = 0.5\n[camera]", {"background"}),
        ("[[surface]]", '[[mesh]]\nmodel = "a.glb"\n[[surface]]', {"meshes"}),
    ],
)
def test_the_parts_that_changed_are_named(watcher, folder, old, new, parts):
    before = watcher.scene
    rewrite(folder, old, new)
    scene = watcher.poll()
    assert scene is watcher.scene is not before
    assert watcher.parts == parts
    assert watcher.changed_files == {folder / "s.toml"}
    assert watcher.poll() is None


@pytest.mark.parametrize(
    ("name", "parts"),
    [("a.png", {"ground"}), ("a.fan", {"instances"}), ("a.ptm", {"surfaces"}), ("deep/c.obj", {"instances"})],
)
def test_a_file_that_was_written_again_names_the_parts_made_of_it(watcher, folder, name, parts):
    (folder / name).write_bytes(b"other")
    assert watcher.poll() is not None
    assert watcher.parts == parts and watcher.changed_files == {folder / name}


def test_a_file_of_the_same_size_is_noticed_by_its_time(watcher, folder):
    (folder / "a.fan").write_bytes(b"x" * len((folder / "a.fan").read_bytes()))
    os.utime(folder / "a.fan", ns=(1, 1))
    assert watcher.poll() is not None


def test_a_model_that_changed_has_its_fan_baked_anew(watcher, folder):
    before = {placement.subject.fan for placement in watcher.scene.instances}
    (folder / "deep/c.obj").write_bytes(b"other")
    after = {placement.subject.fan for placement in watcher.poll().instances}
    assert len(before & after) == 1 and len(after) == 2


def test_a_comment_changes_nothing(watcher, folder):
    rewrite(folder, "[camera]", "# here\n[camera]")
    assert watcher.poll() is None and watcher.message == ""


def test_a_wrong_scene_keeps_the_old_one_and_says_why_until_it_is_right(watcher, folder):
    before = watcher.scene
    rewrite(folder, "seed = 1", "seed = -1")
    assert watcher.poll() is None
    assert watcher.scene is before
    assert "scatter[0].seed: -1; expected" in watcher.message
    assert watcher.poll() is None and "scatter[0].seed: -1; expected" in watcher.message
    rewrite(folder, "seed = -1", "seed = 5")
    assert watcher.poll() is watcher.scene is not before
    assert watcher.message == "" and watcher.parts == {"instances"}


def test_a_mistake_taken_back_leaves_no_message(watcher, folder):
    rewrite(folder, "seed = 1", "seed = -1")
    watcher.poll()
    rewrite(folder, "seed = -1", "seed = 1")
    assert watcher.poll() is None and watcher.message == ""


def test_a_missing_file_is_waited_for(watcher, folder):
    rewrite(folder, "a.png", "new.png")
    assert watcher.poll() is None and "new.png" in watcher.message
    (folder / "new.png").write_bytes(b"1")
    assert watcher.poll() is not None
    assert watcher.scene.ground.texture == folder / "new.png" and watcher.message == ""


def test_a_scene_that_vanishes_and_comes_back(watcher, folder):
    text = (folder / "s.toml").read_text()
    (folder / "s.toml").unlink()
    assert watcher.poll() is None and "does not exist" in watcher.message
    (folder / "s.toml").write_text(text.replace("width = 1", "width = 3"))
    assert watcher.poll().surfaces[0].width == 3


def test_files_changed_while_the_scene_was_wrong_are_not_forgotten(watcher, folder):
    rewrite(folder, "seed = 1", "seed = -1")
    watcher.poll()
    (folder / "a.ptm").write_bytes(b"other")
    watcher.poll()
    rewrite(folder, "seed = -1", "seed = 1")
    assert watcher.poll() is not None
    assert watcher.parts == {"surfaces"} and watcher.changed_files == {folder / "a.ptm", folder / "s.toml"}


def test_a_scene_must_be_right_to_begin_with(folder):
    with pytest.raises(SceneFileError):
        SceneWatcher(folder / "none.toml")
