"""The examples run and draw what they say; the page about embedding shows the example's own code."""

import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from bake.fan import bake_fan
from docs import figures
from impostor import load_model, save
from impostor.files.fan_file import validate_fan
from tests.data import ROOT, SAMPLES


def run(*arguments, cwd=ROOT):
    """Standard output of a Python program that must end well."""
    command = [sys.executable, *map(str, arguments)]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def picture(path):
    """(H, W, 3) int; not blank."""
    pixels = np.asarray(Image.open(path).convert("RGB")).astype(int)
    assert pixels.std(axis=(0, 1)).max() > 5, f"{path} is blank"
    return pixels


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """What the demo prints, and its folder, after it has run a second time over its own outputs."""
    folder = tmp_path_factory.mktemp("demo")
    few = (SAMPLES / "knot.stl", "--views", 8, "--size", 64, "--out", folder)
    run("examples/demo.py", *few)
    return run("examples/demo.py", *few), folder


def test_the_demo_writes_all_that_it_names_and_nothing_else(demo):
    printed, folder = demo
    named = {Path(line.split("  ")[0]) for line in printed.splitlines() if line.startswith(str(folder))}
    assert named == set(folder.iterdir())
    assert {path.suffix for path in named} == {".fan", ".png", ".html"}
    assert validate_fan(folder / "knot.fan") == []
    index = (folder / "index.html").read_text()
    for path in named - {folder / "index.html"}:
        assert f"href='{path.name}'" in index


def test_the_demo_prints_its_error_against_the_mesh(demo):
    found = re.search(r"impostor against mesh.*: ([\d.]+) dB", demo[0])
    assert found and 15 < float(found[1]) < 60


def test_the_demo_relights(demo):
    strip = picture(demo[1] / "knot_relit.png")
    suns = np.split(strip, 4, axis=1)
    for left, right in pairwise(suns):
        assert np.abs(left - right).mean() > 5


def test_the_demo_compares_like_with_like(demo):
    mesh, impostor, _ = np.split(picture(demo[1] / "knot_compare.png"), 3, axis=1)
    assert np.abs(mesh - impostor).mean() < 5


def test_the_demo_says_on_one_line_what_is_wrong(tmp_path):
    command = [sys.executable, "examples/demo.py", "no_such_model.glb", "--out", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("demo: no_such_model.glb: ") and done.stderr.count("\n") == 1


def test_embedding_with_a_fan_of_ones_own(demo, tmp_path):
    run("examples/embed.py", demo[1] / "knot.fan", tmp_path / "own.png")
    assert picture(tmp_path / "own.png").shape == (720, 1280, 3)


def test_embedding_draws_trees_their_shadows_and_four_lights(tmp_path):
    run(ROOT / "examples" / "embed.py", cwd=tmp_path)
    pixels = picture(tmp_path / "embed.png")
    frames = [frame for row in np.split(pixels, 2) for frame in np.split(row, 2, axis=1)]
    assert [path.name for path in tmp_path.iterdir()] == ["embed.png"]
    sky = frames[0][0, 0]
    for frame in frames:
        assert np.array_equal(frame[0, 0], sky)
        ground = frame[-1, -1]
        meadow = frame[frame.shape[0] // 2 :].reshape(-1, 3)
        shaded = meadow.sum(axis=1) < ground.sum() * 0.8
        assert 0.02 < shaded.mean() < 0.8
    # The first and the second sun stand in other places: the same trees are lit otherwise.
    assert np.abs(frames[0] - frames[1]).mean() > 5


# Runs pieces of code one after the other; each has to import what it uses.
PASTED = """
import ast, sys
names = {}
for piece in sys.stdin.read().split("\\0"):
    exec(piece, names)
    for node in ast.walk(ast.parse(piece)):
        for alias in node.names if isinstance(node, (ast.Import, ast.ImportFrom)) else ():
            del names[alias.asname or alias.name]
    if "screen" in names:
        sys.stdout.write(names["screen"].read(components=3).hex() + "\\n")
"""


def test_the_code_on_the_page_runs_as_pasted(tmp_path):
    pieces = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "embedding.md").read_text(), re.DOTALL)
    assert len(pieces) == 9
    (tmp_path / "sample_models").symlink_to(SAMPLES)
    save(tmp_path / "tree.fan", bake_fan(load_model(SAMPLES / "tree.glb"), views=12, size=48))
    done = subprocess.run(
        [sys.executable, "-c", PASTED],
        input="\0".join(pieces),
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    trees, house, *_ = (np.frombuffer(bytes.fromhex(line), np.uint8) for line in done.stdout.splitlines())
    shown = trees.reshape(360, 640, 3)[::-1]
    assert shown[0, 0].tolist() == [178, 204, 230]
    assert shown[150:].astype(int).std(axis=(0, 1)).min() > 10
    assert (trees != house).any()


def test_the_page_about_ptms_runs_as_pasted(tmp_path):
    page = (ROOT / "docs" / "ptm.md").read_text()
    commands, piece = (re.findall(rf"```{kind}\n(.*?)```", page, re.DOTALL) for kind in ("sh", "python"))
    assert len(commands) == len(piece) == 1
    (tmp_path / "sample_models").symlink_to(SAMPLES)
    for line in commands[0].splitlines():
        run("-m", *line.split(), cwd=tmp_path)
    assert picture(tmp_path / "rosette.png").shape == (128, 128, 3)
    assert (tmp_path / "rosette.mp4").stat().st_size > 10_000
    piece = f"{piece[0]}\nimport sys\nsys.stdout.write(screen.color().tobytes().hex())"
    shown = np.frombuffer(bytes.fromhex(run("-c", piece, cwd=tmp_path)), np.uint8).reshape(480, 640, 4)
    assert shown[5, 5].tolist() == [0, 0, 0, 255]
    assert shown[150:330, 200:400, :3].std() > 10


def test_the_example_stays_short():
    assert len((ROOT / "examples" / "embed.py").read_text().splitlines()) < 60


def test_the_cheapest_figures(tmp_path):
    run("-m", "docs.figures", "figure_3", "figure_5a", "figure_5b", "figure_6b", "--out", tmp_path)
    for name in ("figure_3", "figure_5a", "figure_5b", "figure_6b"):
        picture(tmp_path / f"{name}.png")
    assert len(list(tmp_path.iterdir())) == 4
    plain, dithered = picture(tmp_path / "figure_5a.png"), picture(tmp_path / "figure_5b.png")
    assert 0.2 < np.abs(plain - dithered).mean() < 10


def test_an_unknown_figure_is_named(tmp_path, capsys):
    with pytest.raises(SystemExit) as stopped:
        figures.main(["figure_99", "--out", str(tmp_path / "new")])
    assert stopped.value.code == 2
    assert "figure_99: no such figure; expected one of figure_3, " in capsys.readouterr().err
    assert not (tmp_path / "new").exists()
