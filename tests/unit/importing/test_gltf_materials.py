"""What glTF materials ask for is drawn, or told in one line for each kind of thing that is not."""

import warnings

import numpy as np
import pytest

from bake.capture import Capture
from bake.resolve import resolve
from impostor.errors import ModelWarning
from impostor.model import load_model
from impostor.views import View
from tests.data import DATA, needs_data
from tests.pictures import filling
from tests.unit.importing.gltf_builder import GltfBuilder, encoded

REPEAT, CLAMP, MIRROR = 10497, 33071, 33648
# Red and green columns above blue and white ones, large enough that their middles are free of their neighbours.
QUARTERS = np.kron(np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8), np.ones((8, 8, 1)))
RED, GREEN, BLUE, WHITE = (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)
SQUARE = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], "f4")
THREE_TIMES = np.array([[-1, 2], [2, 2], [2, -1], [-1, -1]], "f4")  # the picture, and one beside it on every side
LETTERS = {RED: "r", GREEN: "g", BLUE: "b", WHITE: "w"}


def square(path, uvs=THREE_TIMES, **sampler):
    """A square with a texture, which fills the front view."""
    builder = GltfBuilder()
    material = builder.texture(QUARTERS)
    builder.mesh(SQUARE, (0, 1, 2, 0, 2, 3), np.tile([0, 0, 1], (4, 1)).astype("f4"), material=material, TEXCOORD_0=uvs)
    builder.document["samplers"] = [sampler]
    builder.document["textures"][0]["sampler"] = 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return load_model(builder.write(path))


def letters(picture):
    """Colours of six columns of its second row of six, and of six rows of its second column."""
    at = (np.arange(6) + 0.5) * len(picture) / 6
    rows, columns = at.astype(int), at.astype(int)
    return ["".join(LETTERS[tuple(picture[r, c, :3])] for r, c in zip(*where, strict=True)) for where in (
        ([rows[3]] * 6, columns), (rows, [columns[3]] * 6)
    )]  # fmt: skip


WRAPS = [
    ((REPEAT, REPEAT), ["bwbwbw", "gwgwgw"]),
    ((CLAMP, CLAMP), ["bbbwww", "gggwww"]),
    ((MIRROR, MIRROR), ["wbbwwb", "wggwwg"]),
    ((CLAMP, MIRROR), ["bbbwww", "wggwwg"]),
    ((MIRROR, REPEAT), ["wbbwwb", "gwgwgw"]),
]


@pytest.mark.parametrize(("wrap", "expected"), WRAPS)
def test_a_capture_wraps_as_the_sampler_says(tmp_path, wrap, expected):
    model = square(tmp_path / "a.glb", wrapS=wrap[0], wrapT=wrap[1])
    with Capture(model, 96) as capture:
        layers = resolve(capture.view(View(np.eye(3), np.zeros(3), 1.0, (-1.0, 1.0))), capture.samples)
    assert letters(layers.color) == expected


@pytest.mark.parametrize(("wrap", "expected"), WRAPS)
def test_a_mesh_wraps_as_the_sampler_says(tmp_path, renderer, screen, wrap, expected):
    mesh = renderer.add_mesh(square(tmp_path / "a.glb", wrapS=wrap[0], wrapT=wrap[1]))
    renderer.draw_meshes(*filling(), output="albedo")
    renderer.remove(mesh)
    assert letters(screen.color()) == expected


def test_an_edge_that_is_not_repeated_takes_nothing_from_the_other_side(tmp_path, renderer, screen):
    """Within 0 to 1 a sampler that mirrors is one that clamps: beside the last texel is that texel itself."""
    uvs = np.array([[0, 1], [0.02, 1], [0.02, 0.98], [0, 0.98]], "f4")  # a third of a texel in the lower left corner
    for wrap, expected in ((CLAMP, BLUE), (MIRROR, BLUE)):
        mesh = renderer.add_mesh(square(tmp_path / "a.glb", uvs, wrapS=wrap, wrapT=wrap))
        screen.clear()
        renderer.draw_meshes(*filling(), output="albedo")
        renderer.remove(mesh)
        np.testing.assert_array_equal(screen.color()[5, 5, :3], expected)


def test_a_texture_that_two_meshes_share_is_mirrored_for_the_one_that_leaves_it(tmp_path):
    builder = GltfBuilder()
    material = builder.texture(QUARTERS)
    for uvs in (THREE_TIMES, THREE_TIMES / 3 + 1 / 3):
        builder.mesh(SQUARE, (0, 1, 2), np.tile([0, 0, 1], (4, 1)).astype("f4"), material=material, TEXCOORD_0=uvs)
    builder.document["nodes"], builder.document["scenes"] = [{"mesh": 0}, {"mesh": 1}], [{"nodes": [0, 1]}]
    builder.document["samplers"] = [{"wrapS": MIRROR, "wrapT": MIRROR}]
    builder.document["textures"][0]["sampler"] = 0
    parts = load_model(builder.write(tmp_path / "two.glb")).primitives
    assert [part.material.texture.shape[:2] for part in parts] == [(32, 32), (16, 16)]
    assert [part.material.clamp for part in parts] == [(False, False), (True, True)]


def test_clamping_in_an_mtl_is_drawn(tmp_path):
    (tmp_path / "a.png").write_bytes(encoded(QUARTERS))
    (tmp_path / "a.mtl").write_text("newmtl a\nmap_Kd -clamp on a.png\nnewmtl b\nmap_Kd -clamp off a.png\n")
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 2 0\nvt 0 2\n"
    (tmp_path / "a.obj").write_text(f"mtllib a.mtl\n{corners}usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 2/2 3/3\n")
    parts = {part.material.name: part.material.clamp for part in load_model(tmp_path / "a.obj").primitives}
    assert parts == {"a": (True, True), "b": (False, False)}


# --- what is not drawn


def told(path, *materials):
    """The warnings about materials, each of a triangle."""
    builder = GltfBuilder()
    builder.document["materials"] = list(materials)
    builder.document["images"] = [{"bufferView": builder.view(encoded(QUARTERS))}]
    builder.document["textures"] = [{"source": 0}]
    for index in range(len(materials)):
        builder.mesh(material=index, TEXCOORD_0=np.zeros((3, 2), "f4"))
    builder.document["nodes"] = [{"mesh": index} for index in range(len(materials))]
    builder.document["scenes"] = [{"nodes": list(range(len(materials)))}]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ModelWarning)
        load_model(builder.write(path))
    return [str(warning.message).removeprefix(f"{path}: ") for warning in caught]


PICTURE = {"index": 0}


@pytest.mark.parametrize(
    ("material", "kind"),
    [
        ({"emissiveFactor": [0, 0, 0.1]}, "emission"),
        ({"emissiveFactor": [1, 1, 1], "emissiveTexture": PICTURE}, "emission"),
        ({"occlusionTexture": PICTURE}, "occlusion"),
        ({"pbrMetallicRoughness": {"metallicRoughnessTexture": PICTURE}}, "metalness"),
        ({"pbrMetallicRoughness": {"metallicFactor": 0.5}}, "metalness"),
        ({"pbrMetallicRoughness": {"roughnessFactor": 0.5}}, "metalness"),
    ],
)
def test_what_is_not_drawn_is_told(tmp_path, material, kind):
    assert told(tmp_path / "a.glb", {"name": "lamp", **material}) == [f"material 'lamp': {kind} is not drawn"]


@pytest.mark.parametrize(
    "material",
    [
        {},
        {"emissiveFactor": [0, 0, 0], "emissiveTexture": PICTURE},  # nothing shines: the factor multiplies the picture
        {"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.4}},
        {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1]}},
        {"emissiveFactor": [1, 1, 1], "normalTexture": PICTURE, "extensions": {"KHR_materials_unlit": {}}},
    ],
)
def test_what_asks_for_nothing_more_is_not_told(tmp_path, material):
    assert told(tmp_path / "a.glb", material) == []


def test_each_kind_is_told_once(tmp_path):
    lamp = {"name": "lamp", "emissiveFactor": [1, 1, 1]}
    bulb = {"name": "bulb", "emissiveFactor": [1, 0, 0], "occlusionTexture": PICTURE}
    assert told(tmp_path / "a.glb", lamp, {}, bulb, lamp) == [
        "material 'lamp' and 2 more: emission is not drawn",
        "material 'bulb': occlusion is not drawn",
    ]


@needs_data
def test_the_helmet_says_what_is_left_of_it():
    with pytest.warns(ModelWarning) as caught:
        load_model(DATA / "models/DamagedHelmet.glb")
    kinds = [str(warning.message).rpartition(": ")[2] for warning in caught]
    assert kinds == [f"{kind} is not drawn" for kind in ("emission", "occlusion", "metalness")]
