"""`.fan` files: kept bytes, a second decoder, and everything that must be refused."""

import hashlib
import json
import math
import os
import re
import struct
import tracemalloc
import warnings
import zipfile
import zlib
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import impostor.files
from impostor.errors import FanFileError, OutputError, SettingsError
from impostor.files.fan_file import read_fan, read_manifest, validate_fan, write_fan
from impostor.files.fan_manifest import atlas_grid, parse_manifest
from impostor.normal_code import palette
from tests.fans import bumpy_torus_fan, pattern_fan

GOLDEN = Path(__file__).parents[1] / "golden" / "version_1.fan"  # written once from pattern_fan(), kept for ever
FORMAT_MD = Path(impostor.files.__path__[0]) / "FORMAT.md"


def assert_same(found, expected):
    """Equal to the last bit, types included."""
    assert (found.name, found.layout) == (expected.name, expected.layout)
    assert (found.source, found.settings) == (expected.source, expected.settings)
    assert found.views.distance == expected.views.distance
    for key in ("basis", "center", "radius", "depth_range"):
        assert np.array_equal(getattr(found.views, key), getattr(expected.views, key)), key
    for key in ("color", "depth", "silhouette"):
        a, b = getattr(found, key), getattr(expected, key)
        assert a.dtype == b.dtype, key
        assert np.array_equal(a, b), key
    assert len(found.normal) == len(expected.normal)
    assert all(np.array_equal(a, b) for a, b in zip(found.normal, expected.normal, strict=True))


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


def rebuilt(path, target, change_manifest=None, images=None, layer_table=True):
    """A copy of a fan with another manifest or other images, its layer table and checksums made to fit."""
    with zipfile.ZipFile(path) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    manifest = json.loads(entries["manifest.json"])
    for name, data in (images or {}).items():
        entries[name] = data
    if layer_table:
        for layer in manifest["layers"]:
            layer["sha256"] = hashlib.sha256(entries[layer["file"]]).hexdigest()
    if change_manifest:
        change_manifest(manifest)
    entries["manifest.json"] = json.dumps(manifest).encode()
    return archive_of(target, entries.items())


def archive_of(target, entries, compression=zipfile.ZIP_STORED):
    with warnings.catch_warnings(), zipfile.ZipFile(target, "w", compression) as archive:
        warnings.simplefilter("ignore")  # zipfile warns of an entry that is there twice
        for name, data in entries:
            archive.writestr(zipfile.ZipInfo(name), data, compression)
    return target


def entries_of(path):
    with zipfile.ZipFile(path) as archive:
        return [(name, archive.read(name)) for name in archive.namelist()]


def png(array, **options):
    file = BytesIO()
    Image.fromarray(array).save(file, "PNG", **options)
    return file.getvalue()


def png_of_header(width, height, bit_depth, color_type, rows=b""):
    """A PNG that claims a size, and holds whatever rows are given."""

    def chunk(kind, data):
        return struct.pack(">L", len(data)) + kind + data + struct.pack(">L", zlib.crc32(kind + data))

    header = struct.pack(">2L5B", width, height, bit_depth, color_type, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def refused(path, *words):
    """The one line with which a file is refused, by every way of opening it that looks at the pixels."""
    with pytest.raises(FanFileError) as caught:
        read_fan(path)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{path}: ")
    for word in words:
        assert word in message
    assert validate_fan(path) == [message]
    return message


# Reading and writing


def test_version_1_is_read_for_ever():
    assert_same(read_fan(GOLDEN), pattern_fan())
    assert validate_fan(GOLDEN) == []


@pytest.mark.parametrize(
    "arguments", [{"count": 1}, {"count": 7, "size": 9}, {"count": 2, "levels": 1, "distance": 4.5}]
)
def test_what_is_written_reads_back_to_the_last_bit(tmp_path, arguments):
    fan = pattern_fan(**arguments)
    size = write_fan(tmp_path / "a.fan", fan)
    assert size == (tmp_path / "a.fan").stat().st_size
    assert_same(read_fan(tmp_path / "a.fan"), fan)
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
    image = Image.open(BytesIO(dict(entries_of(tmp_path / "a.fan"))["normal.png"]))
    assert np.array_equal(np.array(image.convert("RGB")), palette()[fan.normal[0][0]])


def test_manifest_reads_without_pixels(tmp_path):
    manifest = read_manifest(GOLDEN)
    assert (manifest.name, manifest.layout, manifest.size, len(manifest.views)) == ("pattern", "ring", 8, 3)
    assert manifest.settings["elevation"] == 14.5
    broken = rebuilt(GOLDEN, tmp_path / "a.fan", images={"depth.png": b"no PNG"})
    assert read_manifest(broken).size == 8
    refused(broken, "depth.png", "not a PNG")


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
    assert_same(read_fan(tmp_path / "a.fan"), pattern_fan())


# Damaged files


def test_truncations_are_refused(tmp_path):
    data, path = GOLDEN.read_bytes(), tmp_path / "a.fan"
    for length in [*range(0, len(data), 17), *range(len(data) - 100, len(data))]:
        path.write_bytes(data[:length])
        with pytest.raises(FanFileError):
            read_fan(path)


@pytest.mark.parametrize("extra", [b"\0", b"extra", bytes(22), b"PK\5\6" + bytes(18)])
def test_bytes_after_or_before_the_archive_are_refused(tmp_path, extra):
    path = tmp_path / "a.fan"
    for data in (GOLDEN.read_bytes() + extra, extra + GOLDEN.read_bytes()):
        path.write_bytes(data)
        refused(path)


def test_a_flipped_bit_is_refused_or_changes_nothing(tmp_path):
    data, path, expected = GOLDEN.read_bytes(), tmp_path / "a.fan", pattern_fan()
    harmless = 0
    for position in range(0, len(data), 11):
        flipped = bytearray(data)
        flipped[position] ^= 1 << position % 8
        path.write_bytes(flipped)
        try:
            fan = read_fan(path)
        except FanFileError:
            continue
        assert_same(fan, expected)
        harmless += 1
    assert harmless < len(data) / 11 * 0.1  # dates and such in the ZIP's headers


def test_what_is_no_fan_is_refused(tmp_path):
    refused(tmp_path / "missing.fan", "no such file")
    refused(tmp_path, "no such file")
    (tmp_path / "a.fan").write_bytes(b"")
    refused(tmp_path / "a.fan", "0 bytes")
    (tmp_path / "a.fan").write_text("version https://git-lfs.github.com/spec/v1\n" * 3)
    refused(tmp_path / "a.fan", "not a .fan")
    refused(archive_of(tmp_path / "b.fan", []), "manifest.json")
    refused(archive_of(tmp_path / "c.fan", [("readme.txt", b"")]), "manifest.json")
    refused(archive_of(tmp_path / "d.fan", [("manifest.json", b"[1, 2")]), "manifest")
    refused(archive_of(tmp_path / "e.fan", [("manifest.json", b"\xff" * 9)]), "manifest")
    refused(archive_of(tmp_path / "f.fan", [("manifest.json", b"[" * 100_000)]), "manifest")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
def test_a_pipe_does_not_hang(tmp_path):
    os.mkfifo(tmp_path / "a.fan")
    refused(tmp_path / "a.fan")


# Archives that lie


def test_entries_must_be_those_of_the_format(tmp_path):
    entries, path = entries_of(GOLDEN), tmp_path / "a.fan"
    assert "'depth.png'" in refused(archive_of(path, [e for e in entries if e[0] != "depth.png"]))
    assert "'more.txt'" in refused(archive_of(path, [*entries, ("more.txt", b"")]))
    assert "'../up.txt'" in refused(archive_of(path, [*entries, ("../up.txt", b"")]))
    assert "'color.png'" in refused(archive_of(path, [*entries, entries[1]]))
    refused(archive_of(path, [entries[0], entries[2], entries[1], *entries[3:]]), "entries")
    refused(archive_of(path, [entries[1], entries[0], *entries[2:]]), "first entry")
    refused(archive_of(path, [*entries, *((f"{n}.txt", b"") for n in range(70))]), "78 entries")


def test_compressed_and_encrypted_entries_are_refused(tmp_path):
    entries, path = entries_of(GOLDEN), tmp_path / "a.fan"
    refused(archive_of(path, entries, zipfile.ZIP_DEFLATED), "compressed")
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in entries:
            archive.writestr(name, data, zipfile.ZIP_DEFLATED if name == "depth.png" else zipfile.ZIP_STORED)
    refused(path, "'depth.png'", "compressed")
    data = bytearray(GOLDEN.read_bytes())
    directory = data.index(b"PK\1\2", data.index(b"PK\1\2") + 1)  # of the second entry
    data[directory + 8] |= 1
    path.write_bytes(data)
    refused(path, "'color.png'", "encrypted")


def test_an_image_changed_by_another_program_is_refused(tmp_path):
    entries = dict(entries_of(GOLDEN))
    entries["color.png"] = png(255 - np.array(Image.open(BytesIO(entries["color.png"]))))
    refused(archive_of(tmp_path / "a.fan", entries.items()), "'color.png'", "altered")


@pytest.mark.parametrize(
    ("name", "image", "words"),
    [
        ("depth.png", png(np.zeros((8, 16), np.uint16)), "is 16x8; the manifest says 24x8 (3 x 1 tiles of 8)"),
        ("depth.png", png(np.zeros((8, 24), np.uint8)), "bit depth 8, colour type 0, interlace 0; expected 16, 0, 0"),
        ("color.png", png(np.zeros((8, 24, 3), np.uint8)), "colour type 2"),
        ("normal_2.png", png(np.zeros((2, 6), np.uint8)), "colour type 0"),
        ("silhouette.png", png(np.zeros((8, 24), np.uint8)), "bit depth 8"),
        ("color.png", png_of_header(60000, 60000, 8, 6), "is 60000x60000"),
        ("color.png", png_of_header(24, 8, 8, 6, rows=bytes(97 * 5)), "cannot be decoded"),
        ("color.png", png_of_header(24, 8, 8, 6, rows=b"\7" * 97 * 8), "cannot be decoded"),
        ("color.png", png_of_header(24, 8, 8, 6)[:60], "cannot be decoded"),
        ("color.png", png_of_header(24, 8, 8, 6)[:33] + png_of_header(99, 8, 8, 6)[8:], "cannot be decoded"),
        ("color.png", b"GIF89a", "not a PNG"),
    ],
)
def test_an_image_that_is_not_what_the_manifest_says(tmp_path, name, image, words):
    assert words in refused(rebuilt(GOLDEN, tmp_path / "a.fan", images={name: image}), repr(name))


def test_a_header_that_lies_costs_no_memory(tmp_path):
    """The manifest and the images agree on 2 GiB of texels, of which the file holds nothing."""

    def huge(manifest):
        manifest["size"], manifest["views"], manifest["columns"] = 4096, manifest["views"][:1] * 8, 8
        for layer, name in zip(manifest["layers"], names, strict=True):
            tile = 4096 if name[-5].isalpha() else 4096 >> int(name[-5])
            layer["width"], layer["height"] = 8 * tile, tile
            layer["sha256"] = hashlib.sha256(images[name]).hexdigest()

    kinds = {"color.png": (8, 6), "depth.png": (16, 0), "silhouette.png": (1, 0)}
    names = [name for name, _ in entries_of(GOLDEN)][1:]
    images = {}
    for name in names:
        tile = 4096 if name[-5].isalpha() else 4096 >> int(name[-5])
        images[name] = png_of_header(8 * tile, tile, *kinds.get(name, (8, 3)))
    path = rebuilt(GOLDEN, tmp_path / "a.fan", huge, images, layer_table=False)
    tracemalloc.start()
    refused(path, "cannot hold")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2**22


def test_an_entry_larger_than_its_texels_is_not_read(tmp_path):
    padded = png(np.zeros((8, 24, 4), np.uint8)) + bytes(200_000)
    refused(rebuilt(GOLDEN, tmp_path / "a.fan", images={"color.png": padded}), "'color.png'", "at most")


# Manifests that lie


def test_a_newer_version_is_refused_by_its_number(tmp_path):
    def newer(manifest):
        manifest["version"] = 2
        manifest["hull"] = manifest.pop("views")

    path = rebuilt(GOLDEN, tmp_path / "a.fan", newer)
    assert refused(path) == f"{path}: format version 2; this program reads up to 1"
    with pytest.raises(FanFileError, match="format version 2"):
        read_manifest(path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"format": "other"}, "$.format: 'other'; expected 'impostor fan'"),
        ({"version": 0}, "$.version: 0; expected 1"),
        ({"version": "1"}, '$.version: "1"; expected `int`'),
        ({"size": 4}, "$.size: 4; expected `int` >= 8"),
        ({"size": 4097}, "$.size: 4097; expected `int` <= 4096"),
        ({"size": 16}, "$.layers[0].width: 24; expected 48"),
        ({"size": 8.5}, "$.size: 8.5; expected `int`"),
        ({"layout": "cube"}, "$.layout: 'cube'; expected one of ring, hemisphere, sphere"),
        ({"columns": 2}, "$.columns, $.rows: 2 x 1 tiles; expected 3 views"),
        ({"rows": 2}, "$.columns, $.rows: 3 x 2 tiles; expected 3 views, and no empty row"),
        ({"columns": 10**30}, "$.columns"),
        ({"distance": 0}, "$.distance: 0; expected `float` > 0"),
        ({"distance": 1.0}, "$.distance: 1; expected more than"),
        ({"views": []}, "$.views: []; expected `array` of length >= 1"),
        ({"views.1.radius": "wide"}, '$.views[1].radius: "wide"; expected `float`, got `str`'),
        ({"views.2.basis": [[1, 0, 0], [0, 1, 0]]}, "$.views[2].basis"),
        ({"views.2.basis": [[1, 0, 0], [0, 1, 0], [0, 0, 1.01]]}, "$.views[2].basis"),
        ({"views.2.basis": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}, "right-handed"),
        ({"views.2.basis": [[1e308, 1e308, 0], [0, 1, 0], [0, 0, 1]]}, "orthonormal"),
        ({"views.0.depth_range": [1, 1]}, "$.views[0].depth_range: 1, 1; expected the lower one first"),
        ({"views.0.roll": 1}, "unknown field `roll`"),
        ({"more": 1}, "unknown field `more`"),
        ({"layers": []}, "$.layers"),
        ({"layers.0.mode": "rgb8"}, '$.layers[0].mode: "rgb8"; expected "rgba8"'),
        ({"layers.0.file": "../color.png"}, '$.layers[0].file: "../color.png"; expected "color.png"'),
        ({"layers.0.sha256": "0"}, '$.layers[0].sha256: "0"; expected'),
        ({"source": {"name": 3}}, "$.source"),
        ({"settings": 3}, "$.settings: 3; expected `object`"),
    ],
)
def test_a_wrong_manifest_is_refused_with_place_value_and_expectation(tmp_path, change, words):
    def edit(manifest):
        for place, value in change.items():
            *parents, key = (int(part) if part.isdigit() else part for part in place.split("."))
            for parent in parents:
                manifest = manifest[parent]
            manifest[key] = value

    path = rebuilt(GOLDEN, tmp_path / "a.fan", edit)
    assert words in refused(path)
    with pytest.raises(FanFileError, match=re.escape(words)):
        read_manifest(path)


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_numbers_that_are_not_finite_are_refused(tmp_path, number):
    entries = dict(entries_of(GOLDEN))
    text = re.sub(rb'"radius": [0-9.]+', b'"radius": ' + number.encode(), entries["manifest.json"], count=1)
    entries["manifest.json"] = text
    refused(archive_of(tmp_path / "a.fan", entries.items()), "manifest")


def test_a_missing_member_is_named(tmp_path):
    path = rebuilt(GOLDEN, tmp_path / "a.fan", lambda manifest: manifest["views"][1].pop("center"))
    refused(path, "$.views[1]: object missing required field `center`")


def test_validate_names_every_layer_whose_texels_are_wrong(tmp_path):
    silhouette = np.array(Image.open(BytesIO(dict(entries_of(GOLDEN))["silhouette.png"])))
    silhouette[2, 11] ^= True
    codes = Image.fromarray(np.full((8, 24), 225, np.uint8))
    codes.putpalette(bytes(768))
    file = BytesIO()
    codes.save(file, "PNG")
    path = rebuilt(
        GOLDEN, tmp_path / "a.fan", images={"silhouette.png": png(silhouette), "normal.png": file.getvalue()}
    )
    first, second = validate_fan(path)
    assert "layer 'normal' level 0: code 225 at row 0, column 0 of view 0; expected 0 to 224, or 255" in first
    assert "layer 'silhouette'" in second
    assert "row 2, column 3 of view 1; expected alpha >= 128" in second


# The text of the format


def test_the_example_in_the_format_is_a_manifest():
    example = re.search(r"```json\n(.*?)```", FORMAT_MD.read_text(encoding="utf-8"), re.DOTALL)
    assert example
    manifest = parse_manifest(example[1].encode(), "FORMAT.md")
    assert len(manifest.views) == manifest.columns == manifest.rows == 1
    members = set(re.findall(r"^\| `(\w+)`", FORMAT_MD.read_text(encoding="utf-8").split("## 5.")[0], re.MULTILINE))
    assert set(manifest.__struct_fields__) | set(manifest.views[0].__struct_fields__) <= members | {"columns", "rows"}
