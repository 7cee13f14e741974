"""Normal maps: from the file to the pixel, in a fan and in the mesh it is compared with."""

import warnings
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from bake.capture import Capture
from bake.fan import bake_fan
from bake.resolve import resolve
from impostor.environment import Environment, Reflection, Room
from impostor.environment.cube import face_directions
from impostor.errors import ModelError, ModelWarning, SettingsError
from impostor.lighting import DirectionalLight
from impostor.model import Material, Model, NormalMap, load_model
from impostor.normal_code import BYTE_TO_NORMAL
from impostor.normal_map import mapped_normals
from impostor.summary import model_summary
from impostor.views import View, rotation_about_y
from runtime.fans.lod import LevelOfDetail
from runtime.meshes.bump import Bump
from tests.data import SAMPLES
from tests.pictures import apart, filling, mesh_picture, placed
from tests.solids import Sphere, solid_model
from tests.unit.importing.gltf_builder import GltfBuilder, encoded

SQUARE = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], "f4")
FACES = np.array([[0, 1, 2], [0, 2, 3]])
UVS = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], "f4")  # v runs down
AHEAD = np.tile([0, 0, 1], (4, 1)).astype("f4")
RIGHT_AND_UP = np.array([4, 3, np.sqrt(8.5**2 - 25)]) / 8.5  # one of the 225 that a fan can hold


def texel(normal):
    """The bytes of a normal."""
    return np.rint(128 + 127 * np.asarray(normal)).astype(np.uint8)


def plain(normal, size=4):
    """A picture of one normal."""
    return np.tile(texel(normal), (size, size, 1))


def quarters(*normals, size=16):
    """A picture of four: upper left and right, lower left and right."""
    return np.kron(texel(normals).reshape(2, 2, 3), np.ones((size, size, 1), np.uint8))


def card(normal_map=None, uvs=UVS, normals=AHEAD, **material):
    """A square that fills the front view."""
    return Model.from_arrays(SQUARE, FACES, normals, uvs=uvs, material=Material(normal_map=normal_map, **material))


def saved(
    path, picture=None, uvs=UVS, uv_name="TEXCOORD_0", tangents=None, sampler=None, scale_of_node=(1, 1, 1), **info
):
    """A glTF square whose only texture is its normal map; gives the path."""
    builder = GltfBuilder()
    content = encoded(plain(RIGHT_AND_UP) if picture is None else picture)
    builder.document["images"].append({"bufferView": builder.view(content)})
    builder.document["textures"].append({"source": 0} if sampler is None else {"source": 0, "sampler": 0})
    builder.document["samplers"] = [] if sampler is None else [sampler]
    builder.document["materials"].append({"name": "skin", "normalTexture": {"index": 0, **info}})
    builder.mesh(SQUARE, FACES.ravel(), AHEAD, material=0, TANGENT=tangents, **{uv_name: uvs})
    builder.document["nodes"] = [{"mesh": 0, "scale": list(scale_of_node)}]
    return builder.write(path)


def loaded(path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return load_model(path)


def captured(model, size=32, basis=None):
    """Normals (S, S, 3) of the view from the front: what a fan codes."""
    basis = np.eye(3) if basis is None else basis
    with Capture(model, size) as capture:
        return resolve(capture.view(View(basis, np.zeros(3), 1.0, (-1.0, 1.0))), capture.samples).normal


@pytest.fixture
def draw(renderer, screen):
    return partial(mesh_picture, renderer, screen, output="normal")


def as_bytes(normals):
    return (np.asarray(normals) / 2 + 0.5) * 255


def test_a_fan_holds_the_normal_of_the_picture(tmp_path):
    fan = bake_fan(loaded(saved(tmp_path / "a.glb")), views=1, elevation_deg=0, size=32)
    found = BYTE_TO_NORMAL[fan.normal[0][0][fan.silhouette[0]]]
    np.testing.assert_allclose(found.mean(axis=0), RIGHT_AND_UP, atol=0.02)
    np.testing.assert_allclose(np.median(found, axis=0), RIGHT_AND_UP, atol=1e-6)


TURNS = {
    "as it is": (UVS, (1, 1)),
    "mirrored": (UVS * (-1, 1), (-1, 1)),
    "upside down": (UVS * (1, -1), (1, -1)),
    "half way round": (-UVS, (-1, -1)),
}


@pytest.mark.parametrize("name", TURNS)
def test_the_picture_leans_the_way_it_lies(draw, name):
    """Green is up in the picture and red right in it, however it is laid on the square."""
    uvs, signs = TURNS[name]
    model = card(NormalMap(plain(RIGHT_AND_UP)), uvs)
    expected = RIGHT_AND_UP * (*signs, 1)
    np.testing.assert_allclose(captured(model)[16, 16], expected, atol=0.01)
    np.testing.assert_allclose(draw(model)[32, 32, :3], as_bytes(expected), atol=1.1)


def test_a_dent_is_lit_where_it_faces_the_light(renderer, draw):
    """Walls of a dent lean inward: lit from the left its right wall is bright, whichever way round the picture is."""
    left_wall, right_wall = (0.6, 0, 0.8), (-0.6, 0, 0.8)
    dent = quarters(left_wall, right_wall, left_wall, right_wall)
    renderer.lights, renderer.ambient = [DirectionalLight((-1, 0, 1))], 0
    both = Model.from_arrays(
        np.vstack([SQUARE * 0.5 - (0.5, 0, 0), SQUARE * 0.5 + (0.5, 0, 0)]),
        np.vstack([FACES, FACES + 4]),
        np.vstack([AHEAD, AHEAD]),
        uvs=np.vstack([UVS, UVS * (-1, 1)]),
        material=Material(normal_map=NormalMap(dent)),
    )
    row = draw(both, output="lit")[32, :, 0].astype(int)
    assert row[24] > row[8] + 50
    assert row[56] > row[40] + 50


@pytest.mark.parametrize(("scale", "x"), [(0.5, 0.3), (2.0, 1.2), (0.0, 0.0), (-1.0, -0.6)])
def test_scale_is_of_what_leans(tmp_path, draw, scale, x):
    model = loaded(saved(tmp_path / "a.glb", plain((0.6, 0, 0.8)), scale=scale))
    expected = np.array([x, 0, 0.8]) / np.hypot(x, 0.8)
    np.testing.assert_allclose(captured(model)[16, 16], expected, atol=0.01)
    np.testing.assert_allclose(draw(model)[32, 32, :3], as_bytes(expected), atol=1.1)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_tangents_of_the_file_count(tmp_path, draw, side):
    """The picture's right is world up here; its up is left, or right where it is mirrored."""
    tangents = np.tile([0, 2, 0.5, side], (4, 1)).astype("f4")
    model = loaded(saved(tmp_path / "a.glb", tangents=tangents))
    expected = np.array([-side * RIGHT_AND_UP[1], RIGHT_AND_UP[0], RIGHT_AND_UP[2]])
    np.testing.assert_allclose(captured(model)[16, 16], expected, atol=0.01)
    np.testing.assert_allclose(draw(model)[32, 32, :3], as_bytes(expected), atol=1.1)


@pytest.mark.parametrize("tangents", [None, np.tile([1, 0, 0, 1], (4, 1)).astype("f4")])
def test_a_node_that_mirrors_mirrors_what_leans(tmp_path, tangents):
    model = loaded(saved(tmp_path / "a.glb", tangents=tangents, scale_of_node=[-1, 1, 1]))
    found = captured(model)[16, 16]
    np.testing.assert_allclose(found, RIGHT_AND_UP * (-1, 1, 1), atol=0.01)


@pytest.mark.parametrize("broken", ["texture coordinates", "tangents"])
def test_where_the_picture_has_no_direction_the_normal_is_the_surfaces_own(tmp_path, draw, broken):
    nowhere = {"uvs": np.full((4, 2), 0.3, "f4")} if broken == "texture coordinates" else {
        "tangents": np.array([[0, 0, 0, 1], [0, 0, 5, 1], [np.nan, 0, 0, 1], [0, 0, -1, -1]], "f4")
    }  # fmt: skip
    model = loaded(saved(tmp_path / "a.glb", **nowhere))
    np.testing.assert_allclose(captured(model)[16, 16], (0, 0, 1), atol=0.01)
    np.testing.assert_allclose(draw(model)[32, 32, :3], as_bytes((0, 0, 1)), atol=1.1)


def test_the_picture_has_texture_coordinates_and_a_sampler_of_its_own(tmp_path, draw):
    """Laid over the square three times and clamped, of the second set and moved: only its last column is seen."""
    left, right = (-0.6, 0, 0.8), (0.6, 0, 0.8)
    path = saved(
        tmp_path / "a.glb", quarters(left, right, left, right), UVS, "TEXCOORD_1", sampler={"wrapS": 33071},
        texCoord=0, extensions={"KHR_texture_transform": {"texCoord": 1, "offset": [1, 0], "scale": [3, 1]}},
    )  # fmt: skip
    model = loaded(path)
    for column in (4, 16, 28):
        np.testing.assert_allclose(captured(model)[16, column], right, atol=0.01)
    assert apart(draw(model)[..., :3], as_bytes(right).round()).max() <= 1


def test_a_picture_turned_by_its_transform_leans_with_it(tmp_path):
    """A quarter turn counter-clockwise of the coordinates is one clockwise of the picture."""
    turn = {"KHR_texture_transform": {"rotation": np.pi / 2}}
    model = loaded(saved(tmp_path / "a.glb", plain((0.6, 0, 0.8)), extensions=turn))
    np.testing.assert_allclose(captured(model)[16, 16], (0, -0.6, 0.8), atol=0.01)


def test_the_pixels_of_a_mesh_are_those_of_numpy(draw):
    """On a turned square with normals that lean themselves, each quarter of the picture."""
    leans = np.array([(0, 0, 1), (0.6, 0, 0.8), (0, -0.8, 0.6), (-0.48, 0.6, 0.64)])
    own = np.array([0.3, -0.2, 1]) / np.linalg.norm([0.3, -0.2, 1])
    model = card(NormalMap(quarters(*leans), scale=0.7), normals=np.tile(own, (4, 1)))
    yaw = 0.4
    picture = draw(model, place=placed(yaw=yaw), matrices=filling(azimuth=0.1))
    tangent = np.array([1, 0, 0]) - own[0] * own
    expected = mapped_normals(own, [*tangent, 1], texel(leans), 0.7) @ rotation_about_y(yaw - 0.1).T
    found = picture[[20, 20, 44, 44], [20, 44, 20, 44], :3]
    np.testing.assert_allclose(found, as_bytes(expected), atol=1.1)
    np.testing.assert_allclose(
        captured(model, 64, rotation_about_y(yaw - 0.1))[[20, 20, 44, 44], [20, 44, 20, 44]], expected, atol=0.01
    )


def wavy(size=64):
    """A picture of gentle waves that repeats."""
    x, y = np.meshgrid(np.arange(size) * (2 * np.pi / size), np.arange(size) * (2 * np.pi / size))
    leans = np.stack([0.6 * np.sin(2 * x), 0.6 * np.cos(3 * y), np.ones_like(x)], axis=-1)
    return texel(leans / np.linalg.norm(leans, axis=-1, keepdims=True))


def test_a_fan_and_its_mesh_lean_alike(draw):
    """A ball, its picture mirrored on one half: within what a byte and one texel of a wave are apart."""
    ball = solid_model(Sphere()).primitives[0]
    uvs = np.column_stack([np.abs(ball.positions[:, 0]), -ball.positions[:, 1]])
    model = Model.from_arrays(
        ball.positions, ball.triangles, ball.normals, uvs=uvs, material=Material(normal_map=NormalMap(wavy()))
    )
    fan, mesh = captured(model, 64), draw(model)
    inner = np.hypot(*np.mgrid[-31.5:32, -31.5:32]) < 26
    difference = np.linalg.norm(mesh[..., :3] / 127.5 - 1 - fan, axis=-1)[inner]
    assert difference.mean() < 0.03
    assert np.quantile(difference, 0.99) < 0.15
    flat = captured(solid_model(Sphere()), 64)
    assert np.linalg.norm(flat - fan, axis=-1)[inner].mean() > 0.3


def uneven():
    x, y, z = np.moveaxis(face_directions(32), -1, 0)
    return Environment("uneven", np.stack([0.4 + 0.3 * x, 0.4 + 0.2 * y, 0.4 + 0.3 * z * x], axis=-1))


@pytest.mark.parametrize("rooms", [0, 1, 2])
@pytest.mark.parametrize("reflection", [None, Reflection()])
def test_light_and_rooms_see_the_mapped_normal(renderer, draw, rooms, reflection):
    """A square with a picture of one normal looks like a square that has that normal."""
    renderer.lights = [DirectionalLight((-1, 1, 1), (0.3, 0.2, 0.1))]
    renderer.rooms = [Room.far(uneven()), Room.box(uneven(), (3, 3, 3))][:rooms]
    found = draw(card(NormalMap(plain(RIGHT_AND_UP))), output="lit", reflection=reflection)
    expected = draw(card(normals=np.tile(RIGHT_AND_UP, (4, 1))), output="lit", reflection=reflection)
    assert apart(found, expected).max() <= 2
    assert apart(found, draw(card(), output="lit", reflection=reflection)).min() > 3


def test_the_mesh_of_a_near_fan_leans(renderer, screen, draw):
    """It looks like the mesh placed by itself, and the fan that it takes over from does as well."""
    model = card(NormalMap(plain(RIGHT_AND_UP)))
    expected = draw(model, output="lit")
    fan = bake_fan(model, views=1, elevation_deg=0, size=64)
    renderer.add(fan, model=model, level_of_detail=LevelOfDetail(mesh_above_px=32, fade_seconds=1))
    pictures = []
    for seconds, half in ((0, 4.0), (0.5, 1.0), (1, 1.0)):
        screen.clear()
        renderer.advance(seconds)
        renderer.draw(*filling(half))
        pictures.append(apart(screen.color(), expected)[8:56, 8:56])
    _, faded, near = pictures
    assert faded.max() <= 6
    assert near.max() == 0


def test_the_back_of_a_surface_leans_as_its_front_turned_round(draw):
    model = card(NormalMap(plain(RIGHT_AND_UP)))
    behind = RIGHT_AND_UP * (1, -1, 1)  # minus the normal, seen from behind: x turns twice
    np.testing.assert_allclose(draw(model, filling(azimuth=np.pi))[32, 32, :3], as_bytes(behind), atol=1.1)
    turn = np.diag([-1.0, 1, -1])
    np.testing.assert_allclose(captured(model, basis=turn)[16, 16], behind, atol=0.01)


def test_parts_with_and_without_a_picture_share_a_mesh(draw):
    half = np.array([0.5, 1, 1])
    left, right = SQUARE * half - (0.5, 0, 0), SQUARE * half + (0.5, 0, 0)
    bare = Model.from_arrays(left, FACES, AHEAD, material=Material())
    mapped = Model.from_arrays(
        right, FACES, AHEAD, uvs=UVS, material=Material(normal_map=NormalMap(plain((0.6, 0, 0.8))))
    )
    both = replace(bare, primitives=bare.primitives + mapped.primitives)
    picture = draw(both)
    np.testing.assert_allclose(picture[32, 16, :3], as_bytes((0, 0, 1)), atol=1.1)
    np.testing.assert_allclose(picture[32, 48, :3], as_bytes((0.6, 0, 0.8)), atol=1.1)
    np.testing.assert_allclose(captured(both)[16, [8, 24]], [(0, 0, 1), (0.6, 0, 0.8)], atol=0.01)


def test_bumps_of_the_caller_take_the_place_of_the_models_map(draw):
    bump = Bump(plain((0, 0.6, 0.8)), bumpiness=0.0)
    found = draw(card(NormalMap(plain(RIGHT_AND_UP))), bump=bump)
    np.testing.assert_array_equal(found, draw(card()))


def test_a_summary_names_their_sizes(tmp_path):
    assert model_summary(saved(tmp_path / "a.glb"))["normal_maps"] == ["4x4"]
    assert model_summary(SAMPLES / "house.glb")["normal_maps"] == []


# --- what cannot be used


def told(path, **options):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ModelWarning)
        model = load_model(path, **options)
    assert all(part.material.normal_map is None for part in model.primitives)
    assert all(part.tangents is None for part in model.primitives)
    return [str(warning.message).removeprefix(f"{path}: ") for warning in caught]


def test_a_map_without_texture_coordinates_is_told(tmp_path):
    place = "meshes[0].primitives[0]: has no TEXCOORD_0, drawn without its normal map"
    assert told(saved(tmp_path / "a.glb", uv_name="TEXCOORD_1")) == [place]


def gltf_with(path, **image):
    builder = GltfBuilder()
    builder.document["images"], builder.document["textures"] = [image], [{"source": 0}]
    builder.document["materials"] = [{"name": "skin", "normalTexture": {"index": 0}}]
    builder.mesh(SQUARE, FACES.ravel(), AHEAD, material=0, TEXCOORD_0=UVS)
    return builder.write(path)


@pytest.mark.parametrize("allowed", [False, True])
def test_a_missing_map_is_told_and_the_model_is_drawn(tmp_path, allowed):
    (line,) = told(gltf_with(tmp_path / "a.glb", uri="skin.png"), allow_missing_textures=allowed)
    assert "'skin.png' is missing, expected a file in" in line
    assert line.endswith("drawn without it")


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"no picture", "cannot be decoded; expected an image; drawn"),
        (encoded(np.tile([9, 8, 7], (4, 4, 1))), "blue is below 128 everywhere"),
        (encoded(np.full((4, 4, 3), 255)), "is grey, as heights are"),
    ],
)
def test_a_map_that_is_none_is_told(tmp_path, content, problem):
    (tmp_path / "skin.png").write_bytes(content)
    (line,) = told(gltf_with(tmp_path / "a.glb", uri="skin.png"))
    assert problem in line
    assert line.endswith("drawn without it")


def test_a_map_that_is_too_large_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr("impostor.importing.materials.LARGEST_TEXTURE", 2)
    (line,) = told(saved(tmp_path / "a.glb"))
    assert line.endswith("is 4x4; expected at most 2 a side; drawn without it")


def test_texels_that_hold_no_normal_take_none_from_the_picture_away(tmp_path):
    picture = quarters(RIGHT_AND_UP, (0, 0, 1), (0, 0, 1), (0, 0, 1))
    picture[:16, 16:] = picture[16:] = 0  # as exporters leave what a cut-out hides
    model = loaded(saved(tmp_path / "a.glb", picture))
    np.testing.assert_allclose(captured(model, 16)[7, 7], RIGHT_AND_UP, atol=0.01)


def test_arrays_need_texture_coordinates_for_a_map():
    with pytest.raises(ModelError, match="normal_map and uvs are None; expected uvs"):
        card(NormalMap(plain((0, 0, 1))), uvs=None)


@pytest.mark.parametrize("picture", [None, np.zeros((4, 4), np.uint8), np.zeros((4, 4, 3)), np.zeros((0, 4, 3), "u1")])
def test_what_is_no_picture_of_normals_is_refused(picture):
    with pytest.raises(SettingsError, match="normal map: a picture of"):
        NormalMap(picture)


# --- OBJ


def obj(folder, line):
    (folder / "n.png").write_bytes(encoded(plain(RIGHT_AND_UP)))
    (folder / "a.mtl").write_text(f"newmtl skin\n{line}\n")
    corners = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n"
    (folder / "a.obj").write_text(f"mtllib a.mtl\n{corners}usemtl skin\nf 1/1/1 2/2/1 3/3/1 4/4/1\n")
    return folder / "a.obj"


@pytest.mark.parametrize("key", ["norm", "map_Kn"])
def test_normal_maps_of_an_mtl_are_drawn(tmp_path, key):
    found = captured(loaded(obj(tmp_path, f"{key} -clamp on n.png")))
    np.testing.assert_allclose(found[16, 16], RIGHT_AND_UP, atol=0.01)


@pytest.mark.parametrize("key", ["bump", "map_Bump"])
def test_height_maps_of_an_mtl_are_told(tmp_path, key):
    assert told(obj(tmp_path, f"{key} n.png")) == ["material 'skin': height map (bump) is not drawn"]
