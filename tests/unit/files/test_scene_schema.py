"""SCENE.md and the schema say the same."""

import re

import pytest

import impostor.model
from impostor.files import scene_schema
from tests.data import ROOT, SAMPLES
from tests.scene_files import load

DOCUMENT = ROOT / "impostor/files/SCENE.md"
TABLES = ["SCENE", "CAMERA", "CAMERA_PATH", "LIGHT", "SUN", "GROUND", "INSTANCE", "BAKE", "SCATTER", "MESH", "SURFACE"]
TABLES += ["ROOM", "REFLECTION"]


def as_toml(key):
    if key.default is scene_schema.REQUIRED:
        return "required"
    if key.default in (None, []):
        return "-"
    if isinstance(key.default, list):
        return f"`[{', '.join(f'{value:g}' for value in key.default)}]`"
    if isinstance(key.default, (bool, str)):
        return f"`{str(key.default).lower()}`" if isinstance(key.default, bool) else f'`"{key.default}"`'
    return f"`{key.default:g}`"


@pytest.mark.parametrize("name", TABLES)
def test_every_key_is_in_the_document_with_its_kind_unit_and_default(name):
    text = DOCUMENT.read_text()
    for key_name, key in getattr(scene_schema, name).items():
        row = f"| `{key_name}` | {key.kind.expected} | {key.unit or '-'} | {as_toml(key)} |"
        assert row in text, row


def test_the_document_names_no_key_that_is_not_read():
    text = DOCUMENT.read_text()
    known = {key for name in TABLES for key in getattr(scene_schema, name)}
    assert set(re.findall(r"^\| `(\w+)` \|", text, re.MULTILINE)) == known


def test_the_example_of_the_document_loads(tmp_path):
    (tmp_path / "sample_models").symlink_to(SAMPLES)
    (tmp_path / "scenes").mkdir()
    (example,) = re.findall(r"```toml\n(.*?)```", DOCUMENT.read_text(), re.DOTALL)
    scene = load(tmp_path / "scenes", example)
    assert len(scene.instances[0]) == 2000 and scene.sun.time_of_day == 9.5


def test_models_of_a_scene_are_those_that_can_be_loaded():
    assert scene_schema.MODEL_SUFFIXES == impostor.model.SUFFIXES
