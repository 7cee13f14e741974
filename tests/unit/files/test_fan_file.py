"""`.fan` files: kept bytes, a second decoder, and fans that cannot be written."""

import hashlib
import json
import math
import os
import re
import zipfile
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import impostor.files
from impostor.errors import OutputError, SettingsError
from impostor.files.fan_file import read_fan, read_manifest, validate_fan, write_fan
from impostor.files.fan_manifest import atlas_grid, parse_manifest
from impostor.normal_code import palette
from tests.fans import GOLDEN, assert_same_fan, bumpy_torus_fan, pattern_fan

FORMAT_MD = Path(impostor.files.__path__[0]) / "FORMAT.md"


def second_decoder(path):
    """FORMAT.md in as few words as can be: zipfile, json and Pillow, a tile at a time."""
    with zipfile.ZipFile(path) as archive:
        manifest = json.loads(archive.read("manifest.json"))
        layers = {}
        for layer in manifest["layers"]:
            data = archive.read(layer["file"])
            assert hashlib.sha256(data).hexdigest() == layer["sha256"]
            atlas = Image.open(BytesIO(data))
            assert atlas.size == (layer["width"], layer["height"])
            side = layer["width"] // manifest["columns"]
            tiles = []
            for view in range(len(manifest["views"])):
                left, top = view % manifest["columns"] * side, view // manifest["columns"] * side
                tiles.append(np.array(atlas.crop((left, top, left + side, top + side))))
            layers[layer["file"]] = np.stack(tiles)
    return manifest, layers


# Reading and writing


def test_version_1_is_read_for_ever():
    assert_same_fan(read_fan(GOLDEN), pattern_fan())
    assert validate_fan(GOLDEN) == []


@pytest.mark.parametrize(
    "arguments", [{"count": 1}, {"count": 7, "size": 9}, {"count": 2, "levels": 1, "distance": 4.5}]
)
def test_what_is_written_reads_back_to_the_last_bit(tmp_path, arguments):
    fan = pattern_fan(**arguments)
    size = write_fan(tmp_path / "a.fan", fan)
    assert size == (tmp_path / "a.fan").stat().st_size
    assert_same_fan(read_fan(tmp_path / "a.fan"), fan)
    assert validate_fan(tmp_path / "a.fan") == []
    assert os.listdir(tmp_path) == ["a.fan"]


def test_the_second_decoder_agrees(tmp_path):
    written = pattern_fan(count=5, size=16, levels=5)
    write_fan(tmp_path / "a.fan", written)
    for path, fan in ((tmp_path / "a.fan", written), (GOLDEN, pattern_fan())):
        manifest, layers = second_decoder(path)
        assert list(layers) == ["color.png", "normal.png", *(f"normal_{k}.png" for k in range(1, len(fan.normal))),
                                "depth.png", "silhouette.png"]  # fmt: skip
        for found, expected in zip(layers.values(), [fan.color, *fan.normal, fan.depth, fan.silhouette], strict=True):
            assert np.array_equal(found, expected)
        assert [view["radius"] for view in manifest["views"]] == fan.views.radius.tolist()
        assert manifest["distance"] is None


def test_same_fan_same_bytes(tmp_path):
    write_fan(tmp_path / "a.fan", pattern_fan())
    write_fan(tmp_path / "b.fan", pattern_fan())
    assert (tmp_path / "a.fan").read_bytes() == (tmp_path / "b.fan").read_bytes()


def test_the_normal_image_looks_like_a_normal_map(tmp_path):
    fan = pattern_fan(count=1)
    write_fan(tmp_path / "a.fan", fan)
    with zipfile.ZipFile(tmp_path / "a.fan") as archive, archive.open("normal.png") as file:
        image = Image.open(file).copy()
    assert np.array_equal(np.array(image.convert("RGB")), palette()[fan.normal[0][0]])


def test_manifest_reads_without_pixels():
    manifest = read_manifest(GOLDEN)
    assert (manifest.name, manifest.layout, manifest.size, len(manifest.views)) == ("pattern", "ring", 8, 3)
    assert manifest.settings["elevation"] == 14.5
    assert np.array_equal(manifest.cameras().center, pattern_fan().views.center)


def test_numbers_of_numpy_in_the_settings_are_written_as_numbers(tmp_path):
    fan = pattern_fan()
    fan.settings["size"], fan.settings["elevation"] = np.int64(8), np.float32(14.5)
    write_fan(tmp_path / "a.fan", fan)
    assert read_fan(tmp_path / "a.fan").settings == pattern_fan().settings


@pytest.mark.parametrize(("count", "grid"), [(1, (1, 1)), (3, (3, 1)), (12, (4, 3)), (96, (12, 8)), (144, (12, 12))])
def test_atlas_grid_leaves_no_place_empty_when_it_can(count, grid):
    assert atlas_grid(count) == grid


def test_every_count_of_views_has_a_legal_grid():
    for count in range(1, 2049):
        columns, rows = atlas_grid(count)
        assert (rows - 1) * columns < count <= rows * columns
        assert columns <= 2 * math.isqrt(count - 1) + 2


@pytest.mark.parametrize(("textured", "limit"), [(False, 4.0), (True, 6.0)])
def test_bytes_per_covered_texel(tmp_path, textured, limit):
    fan = bumpy_torus_fan(textured=textured)
    assert (fan.uniform_albedo is None) == textured
    size = write_fan(tmp_path / "a.fan", fan)
    assert size / fan.covered_texels < limit


# Fans and outputs that are refused before anything is written


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda fan: fan.normal[1].__setitem__((1, 0, 2), 230), "level 1: code 230 at row 0, column 2 of view 1"),
        (lambda fan: fan.silhouette.__setitem__((2, 3, 4), ~fan.silhouette[2, 3, 4]), "row 3, column 4 of view 2"),
        (lambda fan: fan.views.basis.__setitem__((0, 0, 0), 0.5), "$.views[0].basis"),
        (lambda fan: fan.views.basis.__imul__(-1), "right-handed"),
        (lambda fan: fan.views.radius.__setitem__(1, 0), "$.views[1].radius: 0.0; expected"),
        (lambda fan: fan.views.center.__setitem__((1, 2), np.nan), "views"),
        (lambda fan: fan.views.depth_range.__setitem__(1, (2, 1)), "$.views[1].depth_range: 2, 1; expected"),
        (lambda fan: fan.settings.update(elevation=math.inf), "settings"),
        (lambda fan: fan.settings.update(elevation={1, 2}), "settings"),
        (lambda fan: fan.source.update(name="\udcff"), "source"),
    ],
)
def test_a_fan_that_could_not_be_read_back_is_not_written(tmp_path, spoil, words):
    fan = pattern_fan()
    spoil(fan)
    with pytest.raises(SettingsError, match=re.escape(words)):
        write_fan(tmp_path / "a.fan", fan)
    assert os.listdir(tmp_path) == []


def test_an_eye_inside_the_depth_range_is_not_written(tmp_path):
    with pytest.raises(SettingsError, match=r"\$\.distance: 0\.5; expected more than"):
        write_fan(tmp_path / "a.fan", pattern_fan(distance=0.5))


def test_an_existing_file_is_kept_unless_forced(tmp_path):
    (tmp_path / "a.fan").write_bytes(b"mine")
    with pytest.raises(OutputError, match="exists already"):
        write_fan(tmp_path / "a.fan", pattern_fan())
    assert (tmp_path / "a.fan").read_bytes() == b"mine"
    write_fan(tmp_path / "a.fan", pattern_fan(), force=True)
    assert_same_fan(read_fan(tmp_path / "a.fan"), pattern_fan())


# The text of the format


def test_the_example_in_the_format_is_a_manifest():
    example = re.search(r"```json\n(.*?)```", FORMAT_MD.read_text(encoding="utf-8"), re.DOTALL)
    assert example
    manifest = parse_manifest(example[1].encode(), "FORMAT.md")
    assert len(manifest.views) == manifest.columns == manifest.rows == 1
    members = set(re.findall(r"^\| `(\w+)`", FORMAT_MD.read_text(encoding="utf-8").split("## 5.")[0], re.MULTILINE))
    assert set(manifest.__struct_fields__) | set(manifest.views[0].__struct_fields__) <= members | {"columns", "rows"}
