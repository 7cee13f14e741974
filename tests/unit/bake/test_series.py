"""Files of image series, spelled as `.lp` files are."""

import numpy as np
import pytest

from bake.series import read_series
from impostor.errors import LpFileError


@pytest.fixture
def folder(tmp_path):
    for name in ("a.png", "b.png", "my c.png"):
        (tmp_path / name).touch()
    return tmp_path


def read(folder, text, count=1):
    (folder / "focus.txt").write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_series(folder / "focus.txt", count)


@pytest.mark.parametrize(
    "text",
    [
        "a.png 1.5\nb.png 2\nmy c.png 4\n",
        '3\r\na.png\t1.5\r\nb.png\t2\r\n"my c.png"\t4\r\n',
        "a.png;1,5\nb.png;2\nmy c.png;4",
        "a.png,1.5\nb.png,2\nmy c.png,4",
        "/there/a.png 1,5\nC:\\there\\b.png 2\nMY C.PNG 4e0",
        "a.png 1.5\nb.png 2\nmy c.png 4".encode("utf-16"),
    ],
)
def test_one_parameter_is_stretched_to_the_range_of_a_direction(folder, text):
    series = read(folder, text)
    assert [path.name for path in series.photographs] == ["a.png", "b.png", "my c.png"]
    np.testing.assert_array_equal(series.values, [[1.5], [2], [4]])
    np.testing.assert_allclose(series.parameters, [[-1, 0], [-0.6, 0], [1, 0]])
    assert series.ranges() == [(1.5, 4)]


def test_parameters_within_one_stay_as_they_are(folder):
    series = read(folder, "a.png 0.5 10\nb.png -0.25 20\n", 2)
    np.testing.assert_allclose(series.parameters, [[0.5, -1], [-0.25, 1]])


@pytest.mark.parametrize(
    ("text", "count", "expected"),
    [
        ("", 1, "is empty; expected a count, then lines of 'name value'"),
        ("2\na.png 1\n", 1, "counts 2 photographs; 1 lines follow"),
        ("a.png 1\n", 2, "line 1: 'a.png 1'; expected 'name value value'"),
        ("a.png far\n", 1, "line 1: 'a.png far'; expected 'name value'"),
        ("a.png 1e999\n", 1, "line 1: [inf]; expected finite numbers"),
        ("a.png 1\na.png 2\n", 1, "are one file; expected each once"),
        ("a.png,1,5\n", 1, "commas between numbers and in them"),
        ("z.png 1\n", 1, "photograph 'z.png' does not exist"),
        ("1.5\n2.5\n", 1, "name no photographs; expected 'name value'"),
        (b"\x89PNG\r\n\x1a\n\0\0", 1, "is not text; expected lines of 'name value'"),
    ],
)
def test_what_cannot_be_read_is_refused(folder, text, count, expected):
    with pytest.raises(LpFileError) as caught:
        read(folder, text, count)
    assert expected in str(caught.value)


def test_nothing_outside_the_folder_is_opened(folder):
    (folder.parent / "outside.png").touch()
    for name in (folder.parent / "outside.png", "../outside.png"):
        with pytest.raises(LpFileError, match="does not exist"):
            read(folder, f"{name} 1\n")
