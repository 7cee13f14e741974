"""`.lp` files as they are met in the wild, each read or refused in one clear line."""

import time

import numpy as np
import pytest

from impostor.errors import LpFileError, OutputError, SettingsError
from impostor.files.lp_file import LARGEST_FILE, CaptureSet, read_lights, read_lp, write_lp
from tests.data import DATA, needs_data

UNIT = np.array([2, -3, 6]) / 7


@pytest.fixture
def folder(tmp_path):
    """A folder with photographs, which are sought and not opened."""
    for name in ("a.jpg", "b.jpg", "my photo, left.JPG", "shots/c.jpg"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    return tmp_path


def read(folder, text):
    (folder / "set.lp").write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_lp(folder / "set.lp")


def refused(folder, text):
    with pytest.raises(LpFileError) as caught:
        read(folder, text)
    message = str(caught.value)
    assert message.startswith(str(folder / "set.lp")) and "\n" not in message and len(message) < 400
    return message.removeprefix(str(folder / "set.lp"))


@pytest.mark.parametrize(
    "line",
    [
        "a.jpg 2 -3 6",
        "a.jpg\t0.2\t-.3\t6e-1",
        "  a.jpg   2.0 -3. +6  ",
        "a.jpg 0,2 -0,3 0,6",
        "a.jpg,2,-3,6",
        "a.jpg, 0.2, -0.3, 0.6",
        "a.jpg 0.2,-0.3,0.6",
        "a.jpg;0,2;-0,3;0,6",
        "a.jpg ; 0.2 ; -0.3 ; 0.6",
        '"a.jpg" 2 -3 6',
        "C:\\Users\\me\\capture\\a.jpg 2 -3 6",
        "/home of me/capture/a.jpg 2 -3 6",
        "../elsewhere/a.jpg 2 -3 6",
        "A.JPG 2 -3 6",
        "\x61.jpg\u00a02 -3 6",
    ],
)
@pytest.mark.parametrize("count", ["1\n", " 1 \r\n", "", "\ufeff1\n", "\n\n1\n\n"])
def test_lines_as_they_are_met(folder, count, line):
    capture = read(folder, count + line + "\n")
    assert capture.photographs == (folder / "a.jpg",)
    np.testing.assert_allclose(capture.directions, [UNIT], rtol=1e-12)
    assert capture.directions.dtype == np.float64


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r", " \n\n"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_line_ends_and_encodings(folder, ending, encoding):
    text = ending.join(["3", "a.jpg 0 0 1", "my photo, left.JPG 1 0 0", "shots/c.jpg 0 1 0", ""])
    capture = read(folder, text.encode(encoding))
    assert [path.name for path in capture.photographs] == ["a.jpg", "my photo, left.JPG", "c.jpg"]
    np.testing.assert_array_equal(capture.directions, [[0, 0, 1], [1, 0, 0], [0, 1, 0]])


def test_a_name_in_latin_1_is_found(folder):
    (folder / "Löwe.jpg").touch()
    assert read(folder, "1\nLöwe.jpg 0 0 1\n".encode("latin-1")).photographs == (folder / "Löwe.jpg",)


def test_a_foreign_path_keeps_the_folders_that_are_here(folder):
    (folder / "c.jpg").touch()
    assert read(folder, "1\nD:\\rti\\shots\\c.jpg 0 0 1").photographs == (folder / "shots/c.jpg",)


def test_a_name_of_equal_spelling_comes_before_one_of_other_capitals(folder):
    (folder / "A.jpg").touch()
    assert read(folder, "1\nA.jpg 0 0 1").photographs == (folder / "A.jpg",)
    assert "'a.JPG' does not exist" in refused(folder, "1\na.JPG 0 0 1")


def test_nothing_outside_the_folder_is_opened(folder):
    outside = folder.parent / "outside.jpg"
    outside.touch()
    for name in (str(outside), "../outside.jpg", "shots/../../outside.jpg"):
        assert "does not exist" in refused(folder, f"1\n{name} 0 0 1")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "empty"),
        ("0\n", "counts no photographs"),
        ("3\na.jpg 0 0 1\nb.jpg 0 0 1\n", "counts 3 photographs; 2 lines follow"),
        ("1\na.jpg 0 0 1\nb.jpg 0 0 1\n", "counts 1 photographs; 2 lines follow"),
        ("999999999\na.jpg 0 0 1\n", "1 lines follow"),
        ("1\na.jpg 0 0\n", "line 2: 'a.jpg 0 0'; expected"),
        ("1\na.jpg 0 0 up\n", "line 2"),
        ("1\na.jpg 0 0 0\n", "expected a vector of length 1"),
        ("1\na.jpg 1e-9 0 0\n", "expected a vector of length 1"),
        ("1\na.jpg nan 0 1\n", "line 2"),
        ("1\na.jpg 1e999 0 1\n", "expected a vector of length 1"),
        ("2\na.jpg 0 0 1\n0 0 1\n", "line 3: names no photograph"),
        ("1\na.jpg,0,5,-0,5,0,7\n", "commas between numbers and in them"),
        ("2\na.jpg 0 0 1\nz.jpg 0 0 1\n", "photograph 'z.jpg' does not exist"),
        ("2\na.jpg 0 0 1\n/other/a.jpg 1 0 0\n", "are one file"),
        ("0.1 0.2 0.97\n0 0 1\n", "name no photographs"),
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "not text"),
        ("1\n" + "x" * 5000 + "\n", "line 2"),
    ],
)
def test_what_cannot_be_read_is_refused(folder, text, expected):
    assert expected in refused(folder, text)


def test_files_that_are_none(folder):
    for path, problem in ((folder, "directory"), (folder / "none.lp", "does not exist")):
        with pytest.raises(LpFileError, match=problem):
            read_lp(path)


def test_a_huge_file_and_a_long_line_take_no_time(folder):
    began = time.perf_counter()
    assert "larger than" in refused(folder, b"1\n" + b" " * LARGEST_FILE)
    for filling in ("1" * 100_000, "1 " * 100_000, " " * 1_000_000, "1," * 100_000 + "x"):
        refused(folder, f"1\na.jpg {filling} x\n")
    assert time.perf_counter() - began < 5


def test_lights_without_names_are_read_as_lights(folder):
    (folder / "lights.lp").write_text("0 0 2\n0.6 0 0.8\n")
    names, directions = read_lights(folder / "lights.lp")
    assert names == ()
    np.testing.assert_allclose(directions, [[0, 0, 1], [0.6, 0, 0.8]])


def test_what_is_written_is_read_back(folder):
    directions = np.random.default_rng(0).normal(size=(3, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    photographs = tuple(folder / name for name in ("my photo, left.JPG", "shots/c.jpg", "a.jpg"))
    write_lp(CaptureSet(photographs, directions), folder / "out.lp")
    capture = read_lp(folder / "out.lp")
    assert capture.photographs == photographs
    np.testing.assert_allclose(capture.directions, directions, rtol=0, atol=2e-16)
    assert (folder / "out.lp").read_text().startswith("3\nmy photo, left.JPG ")
    with pytest.raises(OutputError, match="exists"):
        write_lp(CaptureSet(photographs, directions), folder / "out.lp")


def test_what_no_lp_can_say_is_not_written(folder):
    up = np.array([[0.0, 0.0, 1.0]])
    names = ("two\nlines.jpg", "blank.jpg ", '"quoted.jpg"', "comma,", "not UTF-8 \udcff.jpg")
    for photographs in ((folder.parent / "outside.jpg",), (), *((folder / name,) for name in names)):
        with pytest.raises(SettingsError):
            write_lp(CaptureSet(photographs, up), folder / "out.lp")
    with pytest.raises(SettingsError, match="twice"):
        write_lp(CaptureSet((folder / "a.jpg", folder / "a.jpg"), np.repeat(up, 2, axis=0)), folder / "out.lp")
    assert not (folder / "out.lp").exists()
    with pytest.raises(SettingsError, match="2 photographs, 1 directions"):
        CaptureSet((folder / "a.jpg", folder / "b.jpg"), up)


@needs_data
def test_real_sets():
    counts = {"hp_fitter_8x5/reference_8x5.lp": 12, "loewenkopf/dirs.lp": 240}
    for name, count in counts.items():
        assert len(read_lp(DATA / "rti" / name).photographs) == count
    assert read_lights(DATA / "rti" / "malformed_no_count.lp")[1].shape == (60, 3)
    with pytest.raises(LpFileError, match="name no photographs"):
        read_lp(DATA / "rti" / "malformed_no_count.lp")
