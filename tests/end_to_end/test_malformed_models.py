"""A model file that is broken, lying or unusual is one line that says what is wrong, or loads whole."""

import base64
import json
import os
import struct
import warnings
import zipfile

import numpy as np
import pytest

from impostor.errors import ModelError, ModelWarning
from impostor.model import load_model
from tests.data import DATA, needs_data
from tests.unit.importing.gltf_builder import TRIANGLE, GltfBuilder, encoded, glb
from tests.unit.importing.test_model import DAE, MESH_3MF, QUARTERS, stl, write_3mf, write_textured_obj

PLY = (
    "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
    "element face {}\nproperty list uchar int vertex_indices\nend_header\n"
)
ASCII_STL = "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
GLTF1 = '{"asset": {"version": "1.0"}, "accessors": {}}'


def refused(path, **options):
    """The message of the one-line error that loading must raise, without a word more on the terminal."""
    with pytest.raises(ModelError) as caught:
        load_model(path, **options)
    message = str(caught.value)
    assert message.startswith(f"{path}: ") and "\n" not in message
    return message


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.obj", b"", "0 bytes"),
        ("a.ply", b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 3033195\n", "Git LFS pointer"),
        ("a.fbx", b"x", "unknown extension '.fbx'; expected one of .3mf, .dae, .glb"),
        ("a.glb", b"not a model", "expected b'glTF'"),
        ("a.glb", glb(b"{}")[:10], "10 bytes; expected a GLB header"),
        ("a.glb", glb(b'{"asset": {"version": "2.0"}}')[:-4], "truncated"),
        ("a.glb", glb(b"{}", version=1), "glTF 1.0 in a binary container"),
        ("a.glb", struct.pack("<4sIIII", b"glTF", 2, 20, 900, 0x4E4F534A), "chunk 0 says 900 bytes"),
        ("a.glb", struct.pack("<4sIIII", b"glTF", 2, 20, 0, 0x004E4942), "first chunk is not JSON"),
        ("a.gltf", b"{", "JSON"),
        ("a.gltf", b"[" * 100_000, "JSON"),
        ("a.gltf", GLTF1.encode(), "glTF 1.0; expected glTF 2.0"),
        ("a.gltf", b'{"asset": {"version": "2.0"}, "nodes": [{"mesh": "x"}]}', "$.nodes[0].mesh"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no triangles"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "uses v 4; expected 1..3"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n", "line 4: 'f 1 2 0' has index 0"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", "line 4: 'f 1 2' has fewer than 3 corners"),
        ("a.obj", b"v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n", "vertex 1 are (nan, 0.0, 0.0)"),
        ("a.obj", b"v 0 0 0\nv 1e300 0 0\nv 0 1 0\nf 1 2 3\n", "beyond 1e+18"),
        ("a.obj", b"v 0 0 0\nv 0 0 0\nv 0 1 0\nf 1 2 3\n", "1 triangles, none of any area"),
        ("a.obj", bytes(range(256)) * 9, "binary data"),
        ("a.ply", b"hello", "expected a PLY header"),
        ("a.ply", PLY.format("binary_little_endian", 2_000_000_000, 1).encode(), "2000000000 vertex"),
        ("a.ply", PLY.format("ascii", 3, 4_000_000_000).encode() + b"0 0 0\n", "4000000000 face"),
        ("a.ply", PLY.format("ascii", 3, 1).replace(" y\n", " w\n").encode() + b"0 " * 40, "no property 'y'"),
        ("a.ply", PLY.format("ascii", 3, 1).encode() + b"0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", "uses vertex 7"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0\n", "no element 'face'"),
        ("a.stl", bytes(80) + np.uint32(4_000_000_000).tobytes() + bytes(50), "4000000000 triangles are"),
        ("a.stl", stl(TRIANGLE[None])[:-1], "1 triangles are 134 bytes, file holds 133"),
        ("a.stl", ASCII_STL.encode(), "no 'endsolid'"),
        ("a.stl", (ASCII_STL.replace("vertex 0 1 0\n", "") + "endsolid").encode(), "expected"),
        ("a.off", b"OFF\n3 9 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "3 vertices and 9 faces, file holds 4 lines"),
        ("a.off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n", "outside the range"),
        ("a.off", b"<html>", "expected OFF"),
        ("a.3mf", b"PK nothing", "expected a 3MF package"),
        ("a.dae", b"<html/>", "expected <COLLADA>"),
        ("a.dae", b"<COLLADA", "XML"),
        ("a.dae", DAE.replace("<instance_geometry", "<instance_controller/><instance_geometry").encode(), "skinned"),
        ("a.dae", DAE.replace('meter="0.01"', 'meter="-1"').encode(), "unit meter='-1'"),
        ("a.dae", DAE.replace('<node id="n">', '<node id="n"><instance_node url="#n"/>').encode(), "holds itself"),
        ("a.dae", DAE.replace('target="#m"', 'target="#gone"').encode(), "gone"),
    ],
)
def test_a_broken_file_is_one_line(tmp_path, capfd, name, content, message):
    path = tmp_path / name
    path.write_bytes(content)
    assert message in refused(path)
    assert capfd.readouterr() == ("", "")


def test_no_file_and_a_directory(tmp_path):
    assert "no such file" in refused(tmp_path / "gone.glb")
    (tmp_path / "folder.obj").mkdir()
    assert "is a directory" in refused(tmp_path / "folder.obj")


@pytest.mark.skipif(os.geteuid() == 0, reason="root reads every file")
def test_an_unreadable_file(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0")
    (tmp_path / "a.obj").chmod(0)
    assert "cannot be read" in refused(tmp_path / "a.obj")


# --- glTF documents


def broken_gltf(path, change):
    """A good file with one thing changed in its document."""
    builder = GltfBuilder()
    builder.mesh(material=builder.texture(QUARTERS), TEXCOORD_0=np.zeros((3, 2), "f4"))
    change(builder.document)
    return builder.write(path)


def put(value, *keys):
    """A change: the item at these keys becomes the value."""

    def change(document):
        for key in keys[:-1]:
            document = document[key]
        document[keys[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put(9, "nodes", 0, "mesh"), "nodes[0]: refers to meshes[9]"),
        (put([5], "scenes", 0, "nodes"), "refers to nodes[5]"),
        (put([0], "nodes", 0, "children"), "tree without loops"),
        (put(3, "scene"), "refers to scenes[3]"),
        (put([], "scenes", 0, "nodes"), "shows none of its 1 meshes"),
        (put(99, "accessors", 0, "count"), "99 elements end at byte"),
        (put(2**60, "accessors", 0, "count"), "expected at most"),
        (put(9, "accessors", 0, "bufferView"), "accessors[0]: refers to"),
        (put(7, "accessors", 0, "componentType"), "accessors[0]: 7"),
        (put(10**6, "bufferViews", 0, "byteLength"), "bufferViews[0]: ends at byte"),
        (put(-1, "bufferViews", 0, "byteOffset"), "$.bufferViews[0].byteOffset"),
        (put({}, "meshes", 0, "primitives", 0, "attributes"), "has no POSITION"),
        (put(2, "accessors", 3, "count"), "2 indices; expected a multiple of 3"),
        (put("SHINY", "materials", 0, "alphaMode"), "alphaMode 'SHINY'"),
        (put(["ACME_quantum_mesh"], "extensionsRequired"), "ACME_quantum_mesh is not known"),
        (put(["EXT_meshopt_compression"], "extensionsUsed"), "EXT_meshopt_compression is not read"),
        (put("image/ktx2", "images", 0, "mimeType"), "images[0] (''): is a KTX2 texture"),
        (put({"KHR_texture_basisu": {"source": 0}}, "textures", 0, "extensions"), "has only KHR_texture_basisu"),
        (put({"bufferView": 1, "name": "bark"}, "images", 0), "images[0] ('bark') cannot be decoded"),
        (put({"uri": "gone.png"}, "images", 0), "'gone.png' is missing"),
        (put({"uri": "../secret.png"}, "images", 0), "refused; expected a file in the model's own folder"),
        (put({"uri": "/etc/passwd"}, "images", 0), "refused"),
        (put({"uri": "https://example.com/a.png"}, "images", 0), "refused"),
        (put({"uri": "..%2Fsecret.png"}, "images", 0), "refused"),
        (put({"uri": "C:\\a.png"}, "images", 0), "refused"),
        (put({"uri": "data:image/png;base64,@@"}, "images", 0), "not base64"),
    ],
)
def test_a_broken_gltf_names_the_place(tmp_path, change, message):
    (tmp_path / "secret.png").write_bytes(encoded(QUARTERS))
    folder = tmp_path / "model"
    folder.mkdir()
    if message.startswith("has only"):
        inner = change

        def change(document):
            inner(document)
            del document["textures"][0]["source"]

    assert message in refused(broken_gltf(folder / "a.glb", change))


def test_gltf_beside_its_files_reads_them_and_misses_them(tmp_path):
    builder = GltfBuilder()
    builder.mesh(material=builder.texture(QUARTERS), TEXCOORD_0=np.zeros((3, 2), "f4"))
    document = {key: value for key, value in builder.document.items() if value != []}
    document["images"] = [{"uri": "my%20skin.png"}]
    document["buffers"] = [{"byteLength": len(builder.binary), "uri": "a.bin"}]
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    (tmp_path / "my skin.png").write_bytes(encoded(QUARTERS))
    assert "buffers[0]: 'a.bin' is missing" in refused(tmp_path / "a.gltf")
    (tmp_path / "a.bin").write_bytes(builder.binary[:-1])
    assert "expected" in refused(tmp_path / "a.gltf")
    (tmp_path / "a.bin").write_bytes(builder.binary)
    np.testing.assert_array_equal(load_model(tmp_path / "a.gltf").primitives[0].material.texture[..., :3], QUARTERS)
    uri = "data:application/octet-stream;base64," + base64.b64encode(builder.binary).decode()
    document["buffers"][0]["uri"] = uri
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    assert load_model(tmp_path / "a.gltf").triangle_count == 1


def test_gltf_instances_beyond_what_can_be_drawn(tmp_path):
    builder = GltfBuilder()
    builder.mesh(indices=[0, 1, 2] * 20_000)
    builder.document["nodes"] = [{"mesh": 0}] * 6000
    builder.document["scenes"] = [{"nodes": list(range(6000))}]
    assert "with all instances" in refused(builder.write(tmp_path / "crowd.glb"))


def test_gltf_draco_that_does_not_decode(tmp_path):
    builder = GltfBuilder()
    primitive = builder.mesh()
    extension = {"bufferView": builder.view(b"DRACO nonsense"), "attributes": {"POSITION": 0}}
    primitive["extensions"] = {"KHR_draco_mesh_compression": extension}
    assert "Draco data cannot be decoded" in refused(builder.write(tmp_path / "d.glb"))


# --- references of other formats


@pytest.mark.parametrize(
    ("mtl", "message"),
    [
        ("map_Kd gone.png", "material 'paint': map_Kd: 'gone.png' is missing"),
        ("map_Kd ../gone.png", "refused"),
        ("map_Kd C:\\textures\\gone.png", "refused"),
        ("map_Kd m.mtl", "cannot be decoded"),
        ("Kd red", "Kd is 'red'; expected one or three numbers"),
    ],
)
def test_a_broken_mtl_names_the_material(tmp_path, mtl, message):
    assert message in refused(write_textured_obj(tmp_path, mtl))


def test_missing_textures_may_be_allowed(tmp_path):
    path = write_textured_obj(tmp_path, "Kd 1 0 0\nmap_Kd gone.png")
    with pytest.warns(ModelWarning, match=r"gone\.png"):
        material = load_model(path, allow_missing_textures=True).primitives[0].material
    assert material.texture is None and material.base_color == (1, 0, 0, 1)
    (tmp_path / "m.mtl").unlink()
    assert "mtllib 'm.mtl': 'm.mtl' is missing" in refused(path)
    with pytest.warns(ModelWarning, match=r"m\.mtl"):
        assert load_model(path, allow_missing_textures=True).triangle_count == 1


def test_a_link_out_of_the_folder_is_refused(tmp_path):
    (tmp_path / "secret.png").write_bytes(encoded(QUARTERS))
    folder = tmp_path / "model"
    folder.mkdir()
    path = write_textured_obj(folder, "map_Kd link.png")
    (folder / "link.png").symlink_to(tmp_path / "secret.png")
    assert "links outside" in refused(path)


def test_ply_texture_that_is_missing(tmp_path):
    text = PLY.format("ascii", 3, 1).replace("ascii 1.0\n", "ascii 1.0\ncomment TextureFile gone.jpg\n")
    (tmp_path / "a.ply").write_text(text + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    assert "'gone.jpg' is missing" in refused(tmp_path / "a.ply")


# --- packages that unroll or unpack without end


def test_3mf_components_of_components(tmp_path):
    levels = "".join(
        f'<object id="{i + 1}"><components>{f"""<component objectid="{i}"/>""" * 2}</components></object>'
        for i in range(1, 60)
    )
    path = write_3mf(tmp_path / "a.3mf", MESH_3MF.format(1) + levels, '<item objectid="60"/>')
    assert "unrolls to" in refused(path)
    loop = '<object id="1"><components><component objectid="1"/></components></object>'
    assert "holds itself" in refused(write_3mf(tmp_path / "b.3mf", loop, '<item objectid="1"/>'))


def test_collada_nodes_of_nodes(tmp_path):
    nodes = "".join(f'<node id="n{i}">{f"""<instance_node url="#n{i - 1}"/>""" * 2}</node>' for i in range(1, 60))
    leaf = '<node id="n0"><instance_geometry url="#g"/></node>'
    text = DAE.replace(
        "<library_visual_scenes>", f"<library_nodes>{leaf}{nodes}</library_nodes><library_visual_scenes>"
    )
    (tmp_path / "a.dae").write_text(text.replace('<node id="n">', '<node id="n"><instance_node url="#n59"/>'))
    assert "unrolls to" in refused(tmp_path / "a.dae")


def test_3mf_that_unpacks_to_gigabytes(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.3mf", "w") as archive:
        archive.writestr("3D/3dmodel.model", "<model/>")
    data = bytearray((tmp_path / "a.3mf").read_bytes())
    central = data.find(b"PK\1\2")
    data[central + 24 : central + 28] = np.uint32(4_000_000_000).tobytes()
    (tmp_path / "a.3mf").write_bytes(data)
    assert "unpacks to 4000000000 bytes" in refused(tmp_path / "a.3mf")


def test_xml_entities_are_not_expanded(tmp_path):
    (tmp_path / "secret").write_text("100")
    entity = f'<!DOCTYPE COLLADA [<!ENTITY x SYSTEM "file://{tmp_path}/secret">]><COLLADA'
    text = DAE.replace("<COLLADA", entity).replace("0 0 0 100 0 0 0 0 100", "0 0 0 &x; 0 0 0 0 &x;")
    (tmp_path / "a.dae").write_text(text)
    refused(tmp_path / "a.dae")


# --- files that broke other importers

LOADS = {
    "assimp__malformed_property_index_oob.3mf": 1,
    "assimp__triangle_with_empty_solid.stl": 1,
    "meshoptimizer__fuzz.glb": 12,
    "tinygltf__zero-sized-bin-chunk-440.glb": 1,
    "trimesh__busted.STL": 3878,
    "trimesh__soup.stl": 100,
    "unsupported_ktx2_BarnLamp/AnisotropyBarnLamp.gltf": 10203,
}
SUFFIXES = (".3mf", ".dae", ".glb", ".gltf", ".obj", ".off", ".ply", ".stl")
REAL = sorted(path for path in (DATA / "malformed").rglob("*") if path.suffix.lower() in SUFFIXES)


@needs_data
@pytest.mark.parametrize("path", REAL, ids=lambda path: path.name)
def test_files_that_broke_other_importers(path, capfd):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        name = path.relative_to(DATA / "malformed").as_posix()
        if name in LOADS:
            assert load_model(path).triangle_count == LOADS[name]
        else:
            refused(path)
    assert capfd.readouterr() == ("", "")
