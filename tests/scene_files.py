"""Scene files for tests, in a folder with files that they can name."""

import pytest

from impostor.errors import SceneFileError
from impostor.files.scene_file import load_scene

CAMERA = "[camera]\neye = [0, 1, 5]\ntarget = [0, 1, 0]\n"


def fill(folder):
    """Make files that scenes name; models, fans and PTMs are hashed, not read."""
    for name in ("a.glb", "b.glb", "a.fan", "a.ptm", "a.png", "a.hdr", "faces/px.jpg", "deep/c.obj"):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(name.encode())
    return folder


def load(folder, text):
    (folder / "s.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
    return load_scene(folder / "s.toml")


def refused(folder, text):
    """The message of one line, after the file's name."""
    with pytest.raises(SceneFileError) as caught:
        load(folder, text)
    message = str(caught.value)
    assert message.startswith(f"{folder / 's.toml'}: ") and "\n" not in message and len(message) < 600
    return message.removeprefix(f"{folder / 's.toml'}: ")


def table(keys, header):
    """A scene of one table."""
    return f"{CAMERA}\n{header}\n{keys}\n"
