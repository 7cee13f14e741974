"""What the tests of the command line share: small models as files, commands in this process, pictures as arrays."""

import json
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from impostor.cli import main

COMMAND = Path(sys.executable).with_name("impostor")
SMALL = ("--views", 4, "--size", 32, "--quiet")
SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
SQUARE_FACES = [[0, 1, 2], [0, 2, 3]]
CUBE = [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]
CUBE_FACES = [
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
    [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
]  # fmt: skip


def run(*arguments):
    """The exit code of one command."""
    return main([str(argument) for argument in arguments])


def ok(capsys, *arguments):
    """What a command that must end well, without a word on standard error, prints."""
    code = run(*arguments)
    out, err = capsys.readouterr()
    assert (code, err) == (0, "")
    return out


def json_of(capsys, *arguments):
    """The JSON that a command prints; NaN and Infinity, which are not JSON, are errors."""

    def refuse(constant):
        raise AssertionError(f"{constant} is not JSON")

    return json.loads(ok(capsys, *arguments), parse_constant=refuse)


def write_obj(path, positions, faces):
    """A mesh as OBJ text."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(positions, float).tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (np.asarray(faces) + 1).tolist()]
    path.write_text("\n".join(lines) + "\n")
    return path


def baked(model, path, *flags):
    """The fan file of a model; nothing is printed."""
    assert run("bake", model, "-o", path, *(flags or SMALL), "--quiet", "--force") == 0
    return path


def rendered(subject, path, *flags):
    """A picture that the command makes of a fan or a model: (H, W) or (H, W, 4) float."""
    assert run("render", subject, "-o", path, "--force", *flags) == 0
    return pixels(path)


def pixels(path):
    """A PNG as an array of floats."""
    with Image.open(path) as image:
        assert image.format == "PNG"
        return np.asarray(image).astype(float)


def overlap(a, b):
    """Intersection over union of two masks."""
    return np.count_nonzero(a & b) / np.count_nonzero(a | b)
