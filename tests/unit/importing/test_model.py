"""A model file becomes the triangles, normals, colours and textures that its format describes."""

import warnings
import zipfile

import DracoPy
import numpy as np
import pytest

from impostor.errors import ModelError, ModelWarning, SettingsError
from impostor.model import Material, Model, load_model
from tests.data import DATA, needs_data
from tests.unit.importing.gltf_builder import TRIANGLE, GltfBuilder, encoded

QUARTERS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
CUBE_FACES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def stl(triangles):
    """Binary STL of (M, 3, 3) corners, its normals left zero."""
    records = np.zeros(len(triangles), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    records["corners"] = triangles
    return bytes(80) + np.uint32(len(triangles)).tobytes() + records.tobytes()


def cylinder(sides=24):
    """Corners of the wall and the caps, (M, 3, 3), about +Z."""
    angles = np.linspace(0, 2 * np.pi, sides + 1)
    low = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    high, pole = low + np.array([0, 0, 2]), np.zeros(3)
    a, b, c, d = low[:-1], low[1:], high[1:], high[:-1]
    bottom = np.stack([np.broadcast_to(pole, a.shape), b, a], axis=1)
    top = np.stack([np.broadcast_to(pole + np.array([0, 0, 2]), a.shape), d, c], axis=1)
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1), bottom, top])


def silent(path, **options):
    """Load; any warning fails the test."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return load_model(path, **options)


def corner_normals(model):
    (primitive,) = model.primitives
    return primitive.positions[primitive.triangles], primitive.normals[primitive.triangles]


def assert_normals_and_winding_agree(model):
    for primitive in model.primitives:
        corners = primitive.positions[primitive.triangles].astype(float)
        faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (np.einsum("ij,ij->i", faces, primitive.normals[primitive.triangles].sum(1)) >= 0).all()
        np.testing.assert_allclose(np.linalg.norm(primitive.normals, axis=1), 1, atol=1e-5)


# --- arrays


def test_arrays_become_a_model_without_degenerate_triangles_or_unused_vertices():
    positions = [*TRIANGLE, [9, 9, 9], [0.5, 0, 0]]
    model = Model.from_arrays(positions, [[0, 1, 2], [0, 0, 1], [0, 4, 1]])
    assert model.triangle_count == 1 and model.vertex_count == 3
    np.testing.assert_array_equal(model.bounds, [[0, 0, 0], [1, 1, 0]])
    assert model.bounds.dtype == np.float64
    (primitive,) = model.primitives
    assert (primitive.positions.dtype, primitive.normals.dtype, primitive.triangles.dtype) == (
        np.float32,
        np.float32,
        np.uint32,
    )
    np.testing.assert_allclose(primitive.normals, [[0, 0, 1]] * 3)


def test_a_triangle_against_its_normals_is_turned():
    model = Model.from_arrays(TRIANGLE, [[0, 1, 2]], normals=[[0, 0, -5]] * 3)
    assert_normals_and_winding_agree(model)
    np.testing.assert_allclose(model.primitives[0].normals, [[0, 0, -1]] * 3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"triangles": [[0, 1, 3]]}, "uses vertex 3; expected 0..2"),
        ({"positions": [[0, 0, 0], [1, np.nan, 0], [0, 1, 0]]}, "vertex 1 are (1.0, nan, 0.0)"),
        ({"triangles": [[0, 1, 1]]}, "none of any area"),
        ({"colors": [[0.5, 0.5, 0.5, 1.0]] * 3}, "expected uint8"),
        ({"uvs": [[0, 0]]}, "uvs have shape (1, 2); expected (3, 2)"),
        ({"material": Material(texture=np.zeros((1, 1, 4), np.uint8))}, "expected uvs"),
    ],
)
def test_arrays_that_make_no_model_are_refused(change, message):
    arrays = {"positions": TRIANGLE, "triangles": [[0, 1, 2]], **change}
    with pytest.raises(ModelError) as caught:
        Model.from_arrays(**arrays)
    assert message in str(caught.value)


# --- normals that a file does not hold


def test_an_stl_cylinder_is_smooth_round_its_wall_and_hard_at_its_rims(tmp_path):
    (tmp_path / "pin.stl").write_bytes(stl(cylinder()))
    model = silent(tmp_path / "pin.stl")
    positions, normals = corner_normals(model)
    corners = positions.astype(float)
    is_cap = np.ptp(corners[..., 2], axis=1) == 0
    np.testing.assert_allclose(np.abs(normals[is_cap][..., 2]), 1, atol=1e-6)
    radial = corners[~is_cap] * [1, 1, 0]
    np.testing.assert_allclose(normals[~is_cap], radial, atol=1e-3)
    # One vertex a wall corner, one a rim corner of each cap, one a pole: the soup was joined.
    assert model.vertex_count == 24 * 2 * 2 + 2


@pytest.mark.parametrize("name", ["cube.obj", "cube.off", "cube.ply"])
def test_a_cube_of_quads_keeps_its_edges(tmp_path, name):
    path = tmp_path / name
    lines = [f"{x} {y} {z}" for x, y, z in CUBE]
    if name.endswith("obj"):
        faces = [" ".join(str(i + 1) for i in face) for face in CUBE_FACES]
        path.write_text("\n".join([f"v {line}" for line in lines] + [f"f {face}" for face in faces]))
    else:
        faces = ["4 " + " ".join(map(str, face)) for face in CUBE_FACES]
        header = "OFF\n8 6 0" if name.endswith("off") else (
            "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
            "element face 6\nproperty list uchar int vertex_indices\nend_header"
        )  # fmt: skip
        path.write_text("\n".join([header, *lines, *faces]) + "\n")
    model = silent(path)
    assert model.triangle_count == 12 and model.vertex_count == 24
    assert_normals_and_winding_agree(model)
    np.testing.assert_allclose(np.abs(model.primitives[0].normals).max(axis=1), 1, atol=1e-6)
    outward = (model.primitives[0].positions - 0.5) * model.primitives[0].normals
    assert (outward.sum(axis=1) > 0).all()


def test_a_binary_ply_of_triangles_and_quads_loads_whole(tmp_path):
    header = (
        "ply\nformat binary_little_endian 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    )
    positions = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]], "<f4")
    faces = b"\4" + np.array([0, 1, 2, 3], "<i4").tobytes() + b"\3" + np.array([1, 4, 2], "<i4").tobytes()
    (tmp_path / "mixed.ply").write_bytes(header.encode() + positions.tobytes() + faces)
    model = silent(tmp_path / "mixed.ply")
    assert model.triangle_count == 3
    corners = model.primitives[0].positions[model.primitives[0].triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(1.5)


def test_gltf_without_normals_is_flat(tmp_path):
    builder = GltfBuilder()
    bent = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.1]], "f4")
    builder.mesh(bent, [0, 1, 2, 2, 1, 3], normals=None)
    model = silent(builder.write(tmp_path / "bent.glb"))
    assert model.vertex_count == 6
    _, normals = corner_normals(model)
    assert (normals == normals[:, :1]).all() and not np.allclose(normals[0], normals[1])


# --- colours and textures


def write_textured_obj(folder, mtl, pixels=QUARTERS, extra="", uvs=((0.25, 0.25), (0.75, 0.25), (0.25, 0.75))):
    (folder / "skin one.png").write_bytes(encoded(pixels))
    (folder / "m.mtl").write_text("newmtl paint\n" + mtl)
    lines = ["mtllib m.mtl", extra, *("v {} {} {}".format(*v) for v in TRIANGLE), *("vt {} {}".format(*t) for t in uvs)]
    (folder / "m.obj").write_text("\n".join([*lines, "usemtl paint", "f 1/1 2/2 3/3"]))
    return folder / "m.obj"


def test_obj_texture_is_the_right_way_up(tmp_path):
    (primitive,) = silent(write_textured_obj(tmp_path, "Kd 1 1 1\nmap_Kd skin one.png")).primitives
    origin = np.flatnonzero((primitive.positions == 0).all(axis=1))[0]
    u, v = primitive.uvs[origin]
    # vt (0.25, 0.25) is in the lower left quarter of the picture.
    assert primitive.material.texture[int(v * 2), int(u * 2)].tolist() == [0, 0, 255, 255]
    assert primitive.material.name == "paint" and primitive.material.double_sided


def test_mtl_colour_is_linearised_and_options_before_a_file_name_are_passed_over(tmp_path):
    path = write_textured_obj(tmp_path, "Kd 0.5 0 1\nmap_Kd -s 1 1 1 -clamp on skin one.png")
    material = silent(path).primitives[0].material
    assert material.base_color == pytest.approx((0.2140, 0.0, 1.0, 1.0), abs=1e-4)
    assert material.texture.shape == (2, 2, 4)


@pytest.mark.parametrize(
    ("alpha", "mode"), [([255, 255, 255, 255], "OPAQUE"), ([0, 255, 255, 0], "MASK"), ([0, 100, 200, 255], "BLEND")]
)
def test_alpha_of_an_obj_texture_decides_its_mode(tmp_path, alpha, mode):
    pixels = np.dstack([QUARTERS, np.array(alpha, np.uint8).reshape(2, 2)])
    path = write_textured_obj(tmp_path, "Kd 1 1 1\nmap_Kd skin one.png", pixels)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        material = load_model(path).primitives[0].material
    assert material.alpha_mode == mode
    assert any("stippled" in str(w.message) for w in caught) == (mode == "BLEND")


def test_map_d_gives_alpha_and_clear_texels_take_the_nearest_colour(tmp_path):
    (tmp_path / "holes.png").write_bytes(encoded(np.array([[0, 255], [0, 255]])))
    path = write_textured_obj(tmp_path, "Kd 1 1 1\nmap_Kd skin one.png\nmap_d holes.png")
    texture = silent(path).primitives[0].material.texture
    assert texture[..., 3].tolist() == [[0, 255], [0, 255]]
    np.testing.assert_array_equal(texture[:, 0, :3], QUARTERS[:, 1])


def test_tr_of_one_stays_visible_and_d_of_a_half_is_half(tmp_path):
    assert silent(write_textured_obj(tmp_path, "Kd 1 1 1\nTr 1.0")).primitives[0].material.alpha_mode == "OPAQUE"
    with pytest.warns(ModelWarning, match="stippled"):
        material = load_model(write_textured_obj(tmp_path, "Kd 1 1 1\nd 0.5")).primitives[0].material
    assert material.base_color[3] == 0.5 and material.alpha_mode == "BLEND"


def test_an_unknown_obj_material_is_named(tmp_path):
    path = write_textured_obj(tmp_path, "Kd 1 1 1")
    path.write_text(path.read_text().replace("usemtl paint", "usemtl varnish"))
    with pytest.warns(ModelWarning, match="'varnish'"):
        assert load_model(path).primitives[0].material.base_color[0] == pytest.approx(0.8)


def test_obj_colours_negative_indices_tabs_and_latin_1(tmp_path):
    text = "# Größe\nv\t0 0 0 1 0 0\nv 1 0 0 0 1 0\n  v 0 1 0 0 0 1\nf -3 -2 -1\nv 5 5 5 0 0 0\n"
    (tmp_path / "old.obj").write_bytes(text.encode("latin-1"))
    (primitive,) = silent(tmp_path / "old.obj").primitives
    order = np.argmax(primitive.positions @ [[0, 1, 0], [0, 0, 1], [0, 0, 0]] + [0.5, 0, 0], axis=1)
    np.testing.assert_array_equal(primitive.colors[:, :3], np.eye(3, dtype=int)[order] * 255)
    assert primitive.material.base_color == (1, 1, 1, 1)


def test_ply_face_colours_reach_every_corner(tmp_path):
    (tmp_path / "f.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 2\nproperty list uchar int vertex_indices\nproperty uchar red\nproperty uchar green\n"
        "property uchar blue\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 255 0 0\n3 0 2 3 0 0 255\n"
    )
    (primitive,) = silent(tmp_path / "f.ply").primitives
    corners = primitive.colors[primitive.triangles][..., :3]
    assert sorted(map(tuple, corners.reshape(-1, 3).tolist())) == [(0, 0, 255)] * 3 + [(255, 0, 0)] * 3
    assert (corners == corners[:, :1]).all()


def test_gltf_texture_row_0_is_v_0_and_material_is_as_written(tmp_path):
    builder = GltfBuilder()
    uvs = np.array([[0.25, 0.25], [0.75, 0.25], [0.25, 0.75]], "f4")
    builder.mesh(material=builder.texture(QUARTERS), TEXCOORD_0=uvs)
    material = builder.document["materials"][0]
    material |= {"name": "leaf", "alphaMode": "MASK", "alphaCutoff": 0.3, "doubleSided": True}
    material["pbrMetallicRoughness"]["baseColorFactor"] = [0.1, 0.2, 0.3, 0.4]
    (primitive,) = silent(builder.write(tmp_path / "leaf.glb")).primitives
    read = primitive.material
    assert (read.name, read.alpha_mode, read.alpha_cutoff, read.double_sided) == ("leaf", "MASK", 0.3, True)
    assert read.base_color == (0.1, 0.2, 0.3, 0.4)
    np.testing.assert_array_equal(primitive.uvs, uvs)
    np.testing.assert_array_equal(read.texture[..., :3], QUARTERS)


def test_gltf_colours_are_linear_and_bytes_are_normalised(tmp_path):
    for colors in (np.array([[0.5, 0, 1, 1]] * 3, "f4"), np.array([[128, 0, 255, 255]] * 3, "u1")):
        builder = GltfBuilder()
        builder.mesh(COLOR_0=colors)
        primitive = silent(builder.write(tmp_path / "c.glb")).primitives[0]
        np.testing.assert_array_equal(primitive.colors, [[188, 0, 255, 255]] * 3)


def test_gltf_normalised_coordinates_second_set_and_texture_transform(tmp_path):
    builder = GltfBuilder()
    second = builder.accessor(np.array([[0, 0], [65535, 0], [0, 65535]], "u2"), normalized=True)
    transform = {"offset": [0.5, 0.25], "rotation": np.pi / 2, "scale": [2, 1]}
    material = builder.texture(QUARTERS, texCoord=1, extensions={"KHR_texture_transform": transform})
    builder.mesh(material=material, TEXCOORD_0=np.zeros((3, 2), "f4"), TEXCOORD_1=second)
    (primitive,) = silent(builder.write(tmp_path / "t.glb")).primitives
    # Scaled, then a quarter turn counter-clockwise on the picture takes right to up (v falls) and down to right.
    np.testing.assert_allclose(primitive.uvs, [[0.5, 0.25], [0.5, -1.75], [1.5, 0.25]], atol=1e-6)


def test_gltf_missing_coordinates_are_told(tmp_path):
    builder = GltfBuilder()
    builder.mesh(material=builder.texture(QUARTERS))
    with pytest.warns(ModelWarning, match="TEXCOORD_0"):
        assert load_model(builder.write(tmp_path / "bare.glb")).primitives[0].material.texture is None


def test_gltf_webp_and_specular_glossiness(tmp_path):
    builder = GltfBuilder()
    material = builder.texture(QUARTERS, "WEBP")
    builder.document["textures"][0] = {"extensions": {"EXT_texture_webp": {"source": 0}}}
    diffuse = {"diffuseFactor": [0.5, 0.5, 0.5, 1], "diffuseTexture": {"index": 0}}
    extensions = {"KHR_materials_pbrSpecularGlossiness": diffuse}
    builder.document["materials"][0] = {"extensions": extensions}
    builder.document["extensionsRequired"] = ["EXT_texture_webp", "KHR_materials_pbrSpecularGlossiness"]
    builder.mesh(material=material, TEXCOORD_0=np.zeros((3, 2), "f4"))
    read = silent(builder.write(tmp_path / "w.glb")).primitives[0].material
    np.testing.assert_array_equal(read.texture[..., :3], QUARTERS)
    assert read.base_color[:3] == (0.5, 0.5, 0.5)


def test_gltf_transmission_is_told(tmp_path):
    builder = GltfBuilder()
    builder.document["materials"] = [{"name": "pane", "extensions": {"KHR_materials_transmission": {}}}]
    builder.mesh(material=0)
    with pytest.warns(ModelWarning, match="'pane': KHR_materials_transmission"):
        load_model(builder.write(tmp_path / "pane.glb"))


# --- scenes


def test_gltf_instances_mirroring_and_children_of_cameras(tmp_path):
    builder = GltfBuilder()
    builder.mesh()
    builder.document["scenes"] = [{"nodes": [0, 2]}]
    builder.document["nodes"] = [
        {"camera": 0, "translation": [10, 0, 0], "children": [1]},
        {"mesh": 0, "scale": [-1, 1, 1]},
        {"mesh": 0, "rotation": [0, np.sqrt(0.5), 0, np.sqrt(0.5)]},
    ]
    model = silent(builder.write(tmp_path / "scene.glb"))
    assert len(model.primitives) == 1 and model.triangle_count == 2
    np.testing.assert_allclose(model.bounds, [[0, 0, -1], [10, 1, 0]], atol=1e-6)
    assert_normals_and_winding_agree(model)
    primitive = model.primitives[0]
    mirrored = primitive.positions[:, 0] > 1
    np.testing.assert_allclose(primitive.normals[mirrored], [[0, 0, 1]] * mirrored.sum(), atol=1e-6)


@pytest.mark.parametrize(("mode", "indices"), [(5, [0, 1, 2, 3]), (6, [0, 1, 3, 2]), (5, None)])
def test_gltf_strips_and_fans(tmp_path, mode, indices):
    builder = GltfBuilder()
    square = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], "f4")
    builder.mesh(square, indices, normals=None, mode=mode)
    model = silent(builder.write(tmp_path / "square.glb"))
    assert model.triangle_count == 2
    np.testing.assert_allclose(model.primitives[0].normals, [[0, 0, 1]] * model.vertex_count, atol=1e-6)


def test_gltf_points_beside_triangles_are_told(tmp_path):
    builder = GltfBuilder()
    points = builder.mesh(mode=0)
    builder.mesh()
    builder.document["meshes"] = [{"primitives": [points, builder.document["meshes"][1]["primitives"][0]]}]
    with pytest.warns(ModelWarning, match="points or lines"):
        assert load_model(builder.write(tmp_path / "points.glb")).triangle_count == 1


def test_gltf_sparse_positions(tmp_path):
    builder = GltfBuilder()
    indices, values = builder.view(np.array([1], "u2").tobytes()), builder.view(np.array([[7, 0, 0]], "f4").tobytes())
    sparse = {
        "count": 1,
        "indices": {"bufferView": indices, "componentType": 5123},
        "values": {"bufferView": values},
    }
    builder.mesh(builder.accessor(TRIANGLE, sparse=sparse))
    assert silent(builder.write(tmp_path / "sparse.glb")).bounds[1, 0] == 7


def test_gltf_skin_stands_in_its_rest_pose_and_ignores_its_node(tmp_path):
    builder = GltfBuilder()
    joints, weights = np.array([[0, 1, 0, 0]] * 3, "u1"), np.array([[0.5, 0.5, 0, 0]] * 3, "f4")
    builder.mesh(JOINTS_0=joints, WEIGHTS_0=weights)
    identity = np.eye(4, dtype="f4").T.reshape(1, 16)
    bind = builder.accessor(np.concatenate([identity, identity]))
    builder.document["skins"] = [{"joints": [1, 2], "inverseBindMatrices": bind}]
    builder.document["scenes"] = [{"nodes": [0, 1, 2]}]
    builder.document["nodes"] = [
        {"mesh": 0, "skin": 0, "translation": [100, 0, 0]},
        {"translation": [0, 4, 0]},
        {"translation": [0, 8, 0]},
    ]
    np.testing.assert_allclose(silent(builder.write(tmp_path / "skin.glb")).bounds, [[0, 6, 0], [1, 7, 0]])


def test_gltf_default_morph_weights(tmp_path):
    builder = GltfBuilder()
    primitive = builder.mesh()
    primitive["targets"] = [{"POSITION": builder.accessor(np.array([[0, 0, 4]] * 3, "f4"))}]
    assert silent(builder.write(tmp_path / "rest.glb")).bounds[1, 2] == 0
    builder.document["meshes"][0]["weights"] = [0.5]
    assert silent(builder.write(tmp_path / "morph.glb")).bounds[1, 2] == 2


def test_gltf_draco(tmp_path):
    builder = GltfBuilder()
    data = DracoPy.encode(TRIANGLE, np.array([[0, 1, 2]]), preserve_order=True)
    unique_id = DracoPy.decode(data).attributes[0]["unique_id"]
    primitive = builder.mesh(normals=None)
    for accessor in builder.document["accessors"]:
        del accessor["bufferView"]
    extension = {"bufferView": builder.view(data), "attributes": {"POSITION": unique_id}}
    primitive["extensions"] = {"KHR_draco_mesh_compression": extension}
    builder.document["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    np.testing.assert_allclose(silent(builder.write(tmp_path / "d.glb")).bounds, [[0, 0, 0], [1, 1, 0]], atol=1e-3)


DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="0.01"/><up_axis>Z_UP</up_axis></asset>
<library_effects><effect id="e"><profile_COMMON><technique sid="t"><lambert>
<diffuse><color>0.5 0 1 1</color></diffuse></lambert></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="9">0 0 0 100 0 0 0 0 100</float_array><technique_common>
<accessor source="#pa" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1" material="s"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="vs"><node id="n"><translate>0 0 300</translate>
<instance_geometry url="#g"><bind_material><technique_common><instance_material symbol="s" target="#m"/>
</technique_common></bind_material></instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#vs"/></scene></COLLADA>"""


def test_collada_unit_axis_transform_and_colour(tmp_path):
    (tmp_path / "m.dae").write_text(DAE)
    for up in ("y", "z"):
        model = silent(tmp_path / "m.dae", up=up)
        np.testing.assert_allclose(model.bounds, [[0, 3, 0], [1, 4, 0]], atol=1e-6)
    assert model.primitives[0].material.base_color == pytest.approx((0.214, 0, 1, 1), abs=2e-3)


def write_3mf(path, resources, build):
    text = f"""<?xml version="1.0"?><model unit="millimeter"
    xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>{resources}</resources>
    <build>{build}</build></model>"""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("3D/3dmodel.model", text)
    return path


MESH_3MF = """<object id="{}" type="model"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1000" y="0" z="0"/>
<vertex x="0" y="0" z="1000"/></vertices><triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh></object>"""


def test_3mf_unit_axis_and_instances(tmp_path):
    twice = '<object id="2"><components><component objectid="1"/><component objectid="1"'
    twice += ' transform="1 0 0 0 1 0 0 0 1 5000 0 0"/></components></object>'
    path = write_3mf(tmp_path / "m.3mf", MESH_3MF.format(1) + twice, '<item objectid="2"/>')
    model = silent(path)
    assert model.triangle_count == 2
    np.testing.assert_allclose(model.bounds, [[0, 0, 0], [6, 1, 0]], atol=1e-6)


# --- the file itself


def test_up_z_turns_z_to_y(tmp_path):
    (tmp_path / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 2 3\nf 1 2 3\n")
    np.testing.assert_allclose(load_model(tmp_path / "m.obj", up="z").bounds, [[0, 0, -2], [1, 3, 0]])
    with pytest.raises(SettingsError, match="'x'; expected 'y' or 'z'"):
        load_model(tmp_path / "m.obj", up="x")


def test_source_hash_follows_the_model_and_its_textures(tmp_path):
    path = write_textured_obj(tmp_path, "Kd 1 1 1\nmap_Kd skin one.png")
    first = silent(path)
    assert first.name == "m" and len(first.source_hash) == 64
    assert silent(path).source_hash == first.source_hash
    (tmp_path / "skin one.png").write_bytes(encoded(255 - QUARTERS))
    second = silent(path).source_hash
    path.write_text(path.read_text() + "\n# edited\n")
    assert len({first.source_hash, second, silent(path).source_hash}) == 3


REAL = {
    "CesiumMilkTruck.glb": 3624,
    "DamagedHelmet.glb": 15452,
    "Duck.glb": 4212,
    "FlightHelmet/FlightHelmet.gltf": 94722,
    "Fox.glb": 576,
    "capsule/capsule.obj": 10000,
    "counterXP.3MF": 83750,
    "cycloidal_vertex_colors.ply": 43368,
    "duck_draco/Duck.gltf": 4212,
    "featuretype.STL": 3476,
    "fuze/fuze.obj": 1000,
    "happy_buddha_112876.obj": 112876,
    "stanford_bunny_69451.ply": 69451,
    "tree_alpha_leaves.glb": 5354,
    "utah_teapot.obj": 6320,
}


@needs_data
@pytest.mark.filterwarnings("ignore::impostor.errors.ModelWarning")
@pytest.mark.parametrize("name", REAL)
def test_real_models_load_whole(name):
    model = load_model(DATA / "models" / name)
    assert model.triangle_count == REAL[name]
    assert np.isfinite(model.bounds).all()
    assert_normals_and_winding_agree(model)


@needs_data
def test_one_duck_in_three_formats():
    plain, draco = load_model(DATA / "models/Duck.glb"), load_model(DATA / "models/duck_draco/Duck.gltf")
    with pytest.raises(ModelError, match=r"duckCM\.tga' is missing"):
        load_model(DATA / "models/duck.dae")
    with pytest.warns(ModelWarning, match="duckCM"):
        collada = load_model(DATA / "models/duck.dae", allow_missing_textures=True)
    np.testing.assert_allclose(plain.bounds, draco.bounds, atol=2e-3)
    np.testing.assert_allclose(plain.bounds, collada.bounds, atol=1e-5)


@needs_data
def test_a_scan_of_871414_triangles_loads_with_normals():
    model = load_model(DATA / "models/stanford_dragon_871414.ply")
    assert 871_000 < model.triangle_count <= 871_414
    np.testing.assert_allclose(np.linalg.norm(model.primitives[0].normals, axis=1), 1, atol=1e-5)
