"""The house rules that no single test of a part can hold: who imports whom, and how large a file grows."""

import ast
import re
import tomllib
from pathlib import Path

import pytest

from runtime.gl import programs
from runtime.renderer import ImpostorRenderer
from runtime.stage.overdraw import OverdrawPass
from runtime.walk.overlay import Overlay
from tests.data import ROOT

PACKAGES = ("impostor", "bake", "runtime")
FILES = {path.relative_to(ROOT).as_posix(): path for package in PACKAGES for path in ROOT.glob(f"{package}/**/*.py")}
MOST_LINES = 450
FLOORS = (
    ("checks", "gl"),
    ("viewing",),
    ("instances", "rooms"),
    ("lights",),
    ("ground", "meshes"),
    ("fans", "surfaces"),
    ("shadows", "animation"),
    ("placed",),
    ("renderer",),
    ("pictures", "compare", "stage"),
    ("walk",),
    ("cli",),
)
"""Files and folders of the runtime, from the ground up: each imports from itself and from floors below."""
MAY_IMPORT = {"impostor": {"impostor"}, "bake": {"bake", "impostor"}, "runtime": {"runtime", "impostor"}}


def imports(path):
    """Top-level names of every module that a file imports anywhere in it."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (name.name.split(".")[0] for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module.split(".")[0] if node.level == 0 else Path(path).relative_to(ROOT).parts[0]


def importers(module):
    return sorted(name for name, path in FILES.items() if module in imports(path))


@pytest.mark.parametrize("name", sorted(FILES))
def test_a_file_imports_only_from_below_and_stays_short(name):
    path, package = FILES[name], name.split("/")[0]
    assert set(imports(path)) & set(PACKAGES) <= MAY_IMPORT[package]
    assert len(path.read_text().splitlines()) < MOST_LINES


def test_the_runtime_stands_on_floors():
    floors = {name: floor for floor, names in enumerate(FLOORS) for name in names}
    homes = {path: path.relative_to(ROOT / "runtime").with_suffix("").parts[0] for path in runtime_files()}
    assert set(floors) == set(homes.values())
    for path, here in homes.items():
        above = {name for name in runtime_imports(path) if name != here and floors[name] >= floors[here]}
        assert not above, f"{path.name} imports from {', '.join(above)}"


def runtime_files():
    return [path for name, path in FILES.items() if name.startswith("runtime/") and path.name != "__init__.py"]


def runtime_imports(path):
    """Folders and files right in the runtime that a file imports from."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "runtime":
            _, *names = node.module.split(".")
            yield from names[:1] or [name.name for name in node.names]


@pytest.mark.parametrize("name", sorted(FILES))
def test_what_was_expected_follows_a_semicolon(name):
    texts = [node.value for node in ast.walk(ast.parse(FILES[name].read_text())) if isinstance(node, ast.Constant)]
    assert not [text for text in texts if isinstance(text, str) and ", expected " in text]


def test_shaders_name_modules_that_there_are():
    shaders = [path for package in PACKAGES for path in ROOT.glob(f"{package}/shaders/**/*.*")]
    named = {
        name for path in shaders for name in re.findall(r"\b(?:impostor|bake|runtime)\.[\w.]*\w", path.read_text())
    }
    modules = {name.removesuffix(".py").replace("/", ".") for name in FILES}
    assert len(named) > 5 and not {name for name in named if not {name, name.rpartition(".")[0]} & modules}


def test_heavy_dependencies_have_one_way_in():
    (trimesh,) = importers("trimesh")
    assert trimesh == "impostor/model.py"
    assert importers("pyrender") == ["bake/capture.py"]
    assert {name.split("/")[0] for name in importers("moderngl")} == {"runtime"}


def test_every_package_and_every_data_file_is_shipped():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    folders = {path.parent.relative_to(ROOT) for path in FILES.values()}
    assert set(settings["packages"]) == {".".join(folder.parts) for folder in folders}
    shipped = {
        file
        for package, patterns in settings["package-data"].items()
        for pattern in patterns
        for file in (ROOT / package.replace(".", "/")).glob(pattern)
        if file.is_file()
    }
    unshipped = {".py", ".pyc"}
    data = {file for package in PACKAGES for file in (ROOT / package).rglob("*") if file.is_file()}
    assert {file for file in data if file.suffix not in unshipped} == shipped


def test_every_shader_of_the_runtime_is_compiled(ctx, monkeypatch):
    compiled = set()

    def read(name, read=programs._with_includes):
        compiled.add(name)
        return read(name)

    monkeypatch.setattr(programs, "_with_includes", read)
    for part in (ImpostorRenderer(ctx, cache_side=256), Overlay(ctx), OverdrawPass(ctx)):
        part.release()
    assert compiled == {path.name for path in programs.SHADERS.glob("*.*")}


def test_includes_do_not_include_and_all_are_used():
    included = set()
    for path in programs.SHADERS.glob("*.*"):
        included |= set(re.findall(r'^#include "([^"]+)"$', path.read_text(), re.MULTILINE))
    files = {path.name: path for path in (programs.SHADERS / "include").iterdir()}
    assert included == set(files)
    assert not any("#include" in path.read_text() for path in files.values())
