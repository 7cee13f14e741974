"""`.fan` files that are damaged, or lie about themselves: each is refused in one line, and costs nothing."""

import hashlib
import json
import os
import re
import struct
import tracemalloc
import warnings
import zipfile
import zlib
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from impostor.errors import FanFileError
from impostor.files.fan_file import read_fan, read_manifest, validate_fan
from tests.fans import GOLDEN, assert_same_fan, pattern_fan


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


def test_the_manifest_reads_where_the_pixels_do_not(tmp_path):
    broken = rebuilt(GOLDEN, tmp_path / "a.fan", images={"depth.png": b"no PNG"})
    assert read_manifest(broken).size == 8
    refused(broken, "depth.png", "not a PNG")


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
        assert_same_fan(fan, expected)
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
    manifest = entries_of(GOLDEN)[0][1].replace(b'"sha256": "', b'"sha256": "\xe7')
    refused(archive_of(tmp_path / "g.fan", [("manifest.json", manifest)]), "manifest is not JSON")


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
