"""Fans that are baked on demand: their names change with whatever changes the fan."""

import re
import shutil

import pytest

from impostor.files.baked_fans import baked_fan_path, model_files
from impostor.scene import BakeSettings
from tests.data import SAMPLES


def test_a_baked_fan_has_another_name_for_anything_that_changes_it(tmp_path):
    (tmp_path / "m.obj").write_text("mtllib my%20m.mtl\nv 0 0 0\n")
    (tmp_path / "my m.mtl").write_text("newmtl a\nmap_Kd -s 1 1 1 t.png\n")
    (tmp_path / "t.png").write_bytes(b"1")
    (tmp_path / "other.png").write_bytes(b"1")
    model, names = tmp_path / "m.obj", []
    assert model_files(model) == (model, tmp_path / "my m.mtl", tmp_path / "t.png")
    names.append(baked_fan_path(tmp_path, model))
    (tmp_path / "other.png").write_bytes(b"22")
    assert baked_fan_path(tmp_path, model) == names[0]
    for settings in (BakeSettings(views=97), BakeSettings(up="z")):
        names.append(baked_fan_path(tmp_path, model, settings))
    for name in ("t.png", "my m.mtl", "m.obj"):
        (tmp_path / name).write_bytes((tmp_path / name).read_bytes() + b"\n")
        names.append(baked_fan_path(tmp_path, model))
    assert len(set(names)) == 6
    assert all(re.fullmatch(r"m-[0-9a-f]{16}\.fan", name.name) for name in names)


def test_the_same_model_elsewhere_has_the_same_name(tmp_path):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        shutil.copy(SAMPLES / "knot.stl", tmp_path / name / "k.stl")
    one, two = (baked_fan_path(tmp_path / name, tmp_path / name / "k.stl") for name in ("one", "two"))
    assert one.name == two.name and one.parent != two.parent


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("m.gltf", '{"images": [{"uri": "t%20x.png"}, {"uri": "data:image/png;base64,AA"}, {"uri": "../up.png"}]}'),
        ("m.dae", "<library_images><image><init_from>t x.png</init_from></image></library_images>"),
        ("m.ply", "ply\nformat ascii 1.0\ncomment TextureFile t x.png\nend_header\n"),
    ],
)
def test_pictures_that_a_model_names_belong_to_it_in_its_own_folder(tmp_path, name, text):
    (tmp_path / "in").mkdir()
    for file in ("in/t x.png", "up.png"):
        (tmp_path / file).touch()
    (tmp_path / "in" / name).write_text(text)
    assert model_files(tmp_path / "in" / name) == (tmp_path / "in" / name, tmp_path / "in" / "t x.png")


def test_where_a_scenes_folder_cannot_be_written_the_users_cache_takes_the_fan(tmp_path, monkeypatch):
    monkeypatch.setattr("impostor.files.baked_fans.os.access", lambda *_: False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = baked_fan_path(tmp_path, SAMPLES / "knot.stl")
    assert path.parent == tmp_path / "cache" / "impostor" / "baked_fans"
    (tmp_path / "baked_fans").mkdir()
    (tmp_path / "baked_fans" / path.name).touch()
    assert baked_fan_path(tmp_path, SAMPLES / "knot.stl") == tmp_path / "baked_fans" / path.name
