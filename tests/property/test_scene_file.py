"""Whatever is in a scene file, there is a scene or one line; and every line that is named is the right one."""

import math
import tempfile
import tomllib
import warnings
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from impostor.errors import SceneFileError, SceneWarning
from impostor.files import scene_schema
from impostor.files.scene_file import load_scene
from impostor.files.toml_lines import line_of, toml_spans
from tests.scene_files import fill

SCENE = """# a comment with "quotes" and [brackets]
ambient = 0.1
background = "#203040"
[camera]
eye = [0, 4]  # over the ground
target = [
    0, 1.5, # inside
    0,
]
[[camera.path]]
time = 0
eye = [0, 4, 1]
target = [0, 0, 0]
[[camera.path]]
time = 2.5
eye = [0, 4, 2]
target = [0, 0, 0]
[sun]
time_of_day = 9
hours_per_second = 0.5
[ground]
tilt_deg = 5
albedo = [0.3, 0.4, 0.2]
[[light]]
azimuth_deg = 30
elevation_deg = -10
[[scatter]]
model = "deep/c.obj"
bake = { views = 24, layout = 'hemisphere', size = 64 }
count = 40
polygon = [[0, 0], [9, 0], [9, 9]]
minimum_distance = 0.2
seed = 7
scale = [0.5, 2]
[[instance]]
fan = "a.fan"
model = "a.glb"
lod = true
position = [1, 2, 3]
gloss = 0.5
[[mesh]]
model = 'a.glb'
yaw_deg = 45
[[surface]]
ptm = '''a.ptm'''
width = 2
height = 2
tiling = [2, 1]
"""
JUNK = (
    ["-1", "0", "1e9", "1e308", "-1e308", "nan", "-inf", "true", "''", '"a.glb"', '"../a.glb"', '"#ffffff"', "[]"]
    + ["{}", "[[]]", "[nan, nan, nan]", "[1, 2, 3]", "[0, 0]", "[1e5, -1e5, 0]", "{ x = 1 }", "99999999999999999999"]
    + ["12:00:00", "1979-05-27", "[[0, 0], [1, 0], [0, 1], [1, 1]]", '"""', "[", "1 2", "0x10", "'/dev/zero.png'"]
)


def read(text):
    """The scene, or the message of a refusal."""
    with tempfile.TemporaryDirectory() as directory, warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        folder = fill(Path(directory))
        (folder / "s.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
        try:
            return load_scene(folder / "s.toml")
        except SceneFileError as error:
            message = str(error)
            assert message.startswith(str(folder / "s.toml")) and "\n" not in message and len(message) < 800
            return message


def assert_sound(scene):
    if isinstance(scene, str):
        return
    assert math.dist(scene.camera.eye, scene.camera.target) > 0
    for placement in scene.instances:
        count = len(placement)
        assert placement.positions.shape == (count, 3)
        assert placement.yaws.shape == placement.scales.shape == (count,)
        assert np.isfinite(placement.positions).all() and np.isfinite(placement.yaws).all()
        assert (placement.scales > 0).all()


def test_the_scene_that_is_changed_is_right():
    assert read(SCENE).instances[0].positions.shape == (1, 3)


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_any_value_gives_a_scene_or_one_line_with_its_place(data):
    spans = toml_spans(SCENE)
    place = data.draw(st.sampled_from(sorted(spans, key=str)))
    first, last = spans[place]
    junk = data.draw(st.sampled_from(JUNK))
    found = read(SCENE[:first] + junk + SCENE[last:])
    assert_sound(found)
    if isinstance(found, str) and "not TOML" not in found and not SCENE[first:last].startswith("["):
        line = int(found.split(": line ")[1].split(":")[0])
        assert 1 <= line <= SCENE.count("\n") + 1


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_any_damage_gives_a_scene_or_one_line(data):
    text = bytearray(SCENE.encode())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(text) - 1))
        kind = data.draw(st.sampled_from(["byte", "cut", "line", "copy"]))
        if kind == "byte":
            text[at] = data.draw(st.sampled_from(b"\0\xff\"'[]{}=.,#\n -9azA\\"))
        elif kind == "cut":
            del text[at : at + data.draw(st.integers(1, 40))]
        elif kind == "line":
            lines = bytes(text).split(b"\n")
            lines.insert(data.draw(st.integers(0, len(lines))), lines[data.draw(st.integers(0, len(lines) - 1))])
            text = bytearray(b"\n".join(lines))
        else:
            text[at:at] = text[: data.draw(st.integers(0, len(text)))]
        if not text:
            break
    assert_sound(read(bytes(text)))


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=60))
def test_any_bytes_give_one_line(data):
    assert isinstance(read(data), str)


keys = st.one_of(st.sampled_from(list(scene_schema.SCENE)), st.text(max_size=4), st.sampled_from("abc"))
scalars = st.one_of(
    st.integers(-(2**40), 2**40), st.floats(allow_nan=False, allow_infinity=False), st.booleans(), st.text(max_size=6)
)
values = st.recursive(
    scalars, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=3), max_leaves=5
)


def quoted(text, data):
    """A text in one of TOML's ways to write it."""
    if "'" not in text and text.isprintable() and data.draw(st.booleans()):
        return f"'{text}'"
    escaped = "".join(char if char.isalnum() or char in " '[]{}#=.," else f"\\U{ord(char):08x}" for char in text)
    return f'"{escaped}"'


def written_key(key, data):
    plain = key and all(char.isascii() and (char.isalnum() or char in "_-") for char in key)
    return key if plain and data.draw(st.booleans()) else quoted(key, data)


def written(value, data):
    """A value in one of TOML's ways, over several lines where it may be."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return quoted(value, data) if data.draw(st.booleans()) else f'""{quoted_long(value)}""'
    if isinstance(value, list):
        gap = data.draw(st.sampled_from(["", " ", "\n", " # ], [\n"]))
        return "[" + gap + "".join(f"{written(each, data)}{gap},{gap}" for each in value) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{written_key(key, data)} = {written(each, data)}" for key, each in value.items()) + "}"
    return repr(value)


def quoted_long(text):
    escaped = "".join(char if char.isalnum() else f"\\U{ord(char):08x}" for char in text)
    return f'"\n{escaped}\\\n  "'


def document(table, data, header=()):
    """A document of a table, its tables under headers, in dotted keys or in line."""
    own, below = [], []
    for key, value in table.items():
        name, way = written_key(key, data), data.draw(st.sampled_from(["line", "header", "dotted"]))
        path = ".".join([*header, name])
        if isinstance(value, dict) and way == "header":
            below += [f"[{path}]{data.draw(st.sampled_from(['', ' # [x]']))}", *document(value, data, (*header, name))]
        elif isinstance(value, dict) and way == "dotted" and value:
            own += [f"{name} . {written_key(inner, data)} = {written(each, data)}" for inner, each in value.items()]
        elif isinstance(value, list) and value and all(isinstance(each, dict) for each in value) and way != "line":
            for each in value:
                below += [f"[[ {path} ]]", *document(each, data, (*header, name))]
        else:
            own.append(f"{name}={written(value, data)}")
    return own + below


def places(value, place=()):
    """Every place of a document's value, with the value."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, each in inner:
        yield (*place, key), each
        yield from places(each, (*place, key))


@settings(max_examples=300, deadline=None)
@given(st.dictionaries(keys, values, max_size=4), st.data())
def test_every_value_of_a_document_is_found_where_it_stands(table, data):
    text = "\n".join(document(table, data)) + "\n"
    read = tomllib.loads(text)
    spans, expected = toml_spans(text), dict(places(read))
    assert spans.keys() == expected.keys()
    for place, value in expected.items():
        first, last = spans[place]
        assert 0 <= first < last <= len(text)
        if not isinstance(value, (dict, list)):
            assert tomllib.loads(f"value = {text[first:last]}")["value"] == value
        assert line_of(text, first) == text[:first].count("\n") + 1
