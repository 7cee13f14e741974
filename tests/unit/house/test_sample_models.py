"""The sample models are what their README says, and the script makes them again."""

import json
import re
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from tests.data import SAMPLES

ROW = re.compile(r"^\| `([\w.]+)` \|.*\| ([\d,]+) \| ([\d.]+) x ([\d.]+) x ([\d.]+) \|", re.MULTILINE)
LISTED = {
    name: (int(count.replace(",", "")), tuple(map(float, size)))
    for name, count, *size in ROW.findall((SAMPLES / "README.md").read_text(encoding="utf-8"))
}


def load(path: Path) -> trimesh.Scene:
    return trimesh.load_scene(path)


def triangles(scene: trimesh.Scene) -> int:
    return sum(len(scene.geometry[scene.graph[node][1]].faces) for node in scene.graph.nodes_geometry)


def gltf(name: str) -> dict:
    data = (SAMPLES / name).read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    return json.loads(data[20 : 20 + length])


def test_readme_lists_every_model():
    on_disk = {path.name for path in SAMPLES.iterdir() if path.suffix in {".glb", ".obj", ".ply", ".stl"}}
    assert set(LISTED) == on_disk


@pytest.mark.parametrize("name", LISTED)
def test_model_stands_on_the_ground_with_the_listed_triangles_and_size(name):
    scene = load(SAMPLES / name)
    count, size = LISTED[name]
    assert triangles(scene) == count
    assert scene.bounds[0][1] == pytest.approx(0.0, abs=1e-3)
    assert scene.extents == pytest.approx(size, rel=0.01, abs=0.01)
    middle = scene.bounds.mean(axis=0)[[0, 2]]
    assert np.abs(middle).max() < 0.02 * scene.extents.max()


def test_together_they_stay_small():
    models = [path for path in SAMPLES.iterdir() if path.suffix in {".glb", ".obj", ".mtl", ".png", ".ply", ".stl"}]
    assert sum(path.stat().st_size for path in models) < 8_000_000


def test_same_bytes_on_every_run(tmp_path):
    runs = [tmp_path / "first", tmp_path / "second"]
    for folder in runs:
        command = [sys.executable, SAMPLES / "make_samples.py", "--out", folder, "knot", "lattice"]
        subprocess.run(command, check=True, capture_output=True)
    for name in ("knot.stl", "lattice.glb"):
        assert (runs[0] / name).read_bytes() == (runs[1] / name).read_bytes()
        made, kept = load(runs[0] / name), load(SAMPLES / name)
        assert triangles(made) == triangles(kept)
        np.testing.assert_allclose(made.bounds, kept.bounds, atol=1e-5)


def test_unknown_model_is_refused_by_name(tmp_path):
    command = [sys.executable, SAMPLES / "make_samples.py", "--out", tmp_path, "teapot"]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 2
    assert "teapot" in result.stderr


def test_tree_leaves_are_masked_two_sided_and_lean_outward():
    leaves = next(material for material in gltf("tree.glb")["materials"] if material["name"] == "leaves")
    assert leaves["alphaMode"] == "MASK"
    assert leaves["doubleSided"] is True
    crown = max(load(SAMPLES / "tree.glb").geometry.values(), key=lambda mesh: len(mesh.vertices))
    outward = crown.vertices - crown.vertices.mean(axis=0)
    assert (np.einsum("ij,ij->i", outward, crown.vertex_normals) > 0).mean() > 0.95


def test_statue_has_one_untextured_material_and_outward_faces():
    description = gltf("statue.glb")
    assert len(description["materials"]) == 1
    assert "images" not in description
    statue = next(iter(load(SAMPLES / "statue.glb").geometry.values()))
    corner_normals = statue.vertex_normals[statue.faces].mean(axis=1)
    assert (np.einsum("ij,ij->i", statue.face_normals, corner_normals) > 0).mean() > 0.99


def test_truck_repeats_its_wheel_and_mirrors_its_side():
    nodes = gltf("truck.glb")["nodes"]
    assert len(nodes) >= 20
    wheel = next(node["mesh"] for node in nodes if node["name"] == "front left wheel")
    assert sum(node.get("mesh") == wheel for node in nodes) == 5
    assert any(np.prod(node.get("scale", [1, 1, 1])) < 0 for node in nodes)


def test_shell_keeps_its_vertex_colors():
    mesh = next(iter(load(SAMPLES / "shell.ply").geometry.values()))
    assert mesh.visual.kind == "vertex"
    assert len(np.unique(mesh.visual.vertex_colors, axis=0)) > 1000
