"""A model keeps its shape wherever its file has put it: what stands far from the origin is drawn as it is near it."""

import numpy as np
import pytest

from bake.fan import bake_fan
from impostor.errors import ModelError, ModelWarning
from impostor.model import Model, load_model
from impostor.normal_code import decode
from impostor.summary import _ranges
from runtime.compare import Comparison
from runtime.pictures import PictureSettings, draw_picture, orbit_camera
from runtime.viewing.cameras import Camera
from tests.data import SAMPLES
from tests.end_to_end.commands import write_obj
from tests.unit.importing.gltf_builder import GltfBuilder
from tests.unit.importing.test_model import silent, stl

FAR = np.array([4.2e6, -300.0, 9e5])
FEW = {"views": 4, "size": 64}


@pytest.fixture(scope="module")
def knots(tmp_path_factory):
    """A model around the origin, and the same one far away; both from text."""
    folder = tmp_path_factory.mktemp("knots")
    (part,) = load_model(SAMPLES / "knot.stl").primitives
    points = part.positions.astype(float).round(6)
    return [
        silent(write_obj(folder / f"{name}.obj", points + place, part.triangles))
        for name, place in (("near", np.zeros(3)), ("far", FAR))
    ]


def test_a_far_model_keeps_its_shape_and_its_normals(knots):
    near, far = knots
    np.testing.assert_allclose(far.bounds, near.bounds + FAR, atol=1e-6)
    assert far.radius == pytest.approx(near.radius, rel=1e-6)
    ((before, after),) = zip(near.primitives, far.primitives, strict=True)
    np.testing.assert_allclose(after.positions - FAR, before.positions, atol=1e-6)
    np.testing.assert_allclose(after.normals, before.normals, atol=1e-4)
    np.testing.assert_array_equal(after.triangles, before.triangles)


def test_positions_have_32_bits_as_long_as_these_show_no_error(knots):
    near, far = knots
    assert near.primitives[0].positions.dtype == np.float32
    assert far.primitives[0].positions.dtype == np.float64


def test_a_triangle_of_a_metre_in_a_hundred_million_is_one(tmp_path):
    model = silent(write_obj(tmp_path / "far.obj", [[1e8, 0, 0], [1e8 + 1, 0, 0], [1e8, 1, 0]], [[0, 1, 2]]))
    np.testing.assert_array_equal(np.ptp(model.bounds, axis=0), (1, 1, 0))


def test_vertices_far_away_are_welded_by_the_size_of_the_object(tmp_path):
    """Soup: the step of weld is a part of the coordinate, and there would join what is a decimetre apart."""
    path = tmp_path / "soup.obj"
    corners = load_model(SAMPLES / "knot.stl").primitives[0]
    soup = corners.positions[corners.triangles].reshape(-1, 3).astype(float).round(6)
    faces = np.arange(len(soup)).reshape(-1, 3)
    near, far = (silent(write_obj(path, soup + place, faces)) for place in (np.zeros(3), FAR))
    assert far.vertex_count == near.vertex_count < len(soup)


def test_a_node_may_put_a_small_mesh_far_away(tmp_path):
    """The file's numbers are exact: only their sum needs more than 32 bits."""
    builder = GltfBuilder()
    builder.mesh()
    builder.document["nodes"] = [{"mesh": 0, "translation": FAR.tolist()}]
    model = silent(builder.write(tmp_path / "far.glb"))
    np.testing.assert_array_equal(model.primitives[0].positions - FAR, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])


def test_a_skin_may_too(tmp_path):
    builder = GltfBuilder()
    joints, weights = np.zeros((3, 4), "u1"), np.tile(np.array([1, 0, 0, 0], "f4"), (3, 1))
    builder.mesh(JOINTS_0=joints, WEIGHTS_0=weights)
    builder.document["nodes"] = [{"mesh": 0, "skin": 0, "children": [1]}, {"translation": FAR.tolist()}]
    builder.document["skins"] = [{"joints": [1]}]
    model = silent(builder.write(tmp_path / "far.glb"))
    np.testing.assert_array_equal(model.primitives[0].positions - FAR, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])


def test_coordinates_that_the_file_itself_has_rounded_are_told(tmp_path):
    path = tmp_path / "rounded.stl"
    path.write_bytes(stl(np.array([[[0, 0, 0], [60, 0, 0], [0, 60, 0]]]) + [4.2e6, 0, 0]))
    with pytest.warns(ModelWarning, match=r"rounded\.stl: coordinates at 4\.2e\+06 m are 0\.5 m apart .* size of 60 m"):
        load_model(path)
    path.write_bytes(stl(np.array([[[0, 0, 0], [60, 0, 0], [0, 60, 0]]]) + [420, 0, 0]))
    silent(path)


def test_coordinates_that_have_rounded_into_one_are_the_reason(tmp_path):
    path = tmp_path / "gone.stl"
    path.write_bytes(stl(np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]) + [1e8, 0, 0]))
    with pytest.raises(ModelError, match=r"none of any area: coordinates at 1e\+08 m are 8 m apart .*; expected"):
        load_model(path)


def test_it_bakes_as_it_would_near_the_origin(knots):
    near, far = (bake_fan(model, **FEW) for model in knots)
    np.testing.assert_allclose(far.views.center, near.views.center + FAR, atol=1e-5)
    np.testing.assert_allclose(far.views.radius, near.views.radius, rtol=1e-5)
    assert np.mean(far.silhouette != near.silhouette) < 1e-3
    covered = near.silhouette & far.silhouette
    assert np.mean(np.abs(far.depth.astype(int) - near.depth)[covered] > 64) < 0.01
    cosines = (decode(far.normal[0][covered]) * decode(near.normal[0][covered])).sum(axis=-1)
    assert np.mean(cosines) > 0.999  # a last bit more or less is diffused to other texels


def test_its_mesh_may_be_put_back(knots, renderer, screen):
    camera = orbit_camera(knots[0], 0.3, 0.2, 1.0)
    pictures = []
    for model, place in zip(knots, (np.zeros(3), -FAR), strict=True):
        matrix = np.eye(4)
        matrix[:3, 3] = place
        mesh = renderer.add_mesh(model, matrix)
        screen.clear()
        renderer.draw_meshes(*camera.matrices)
        pictures.append(screen.color().astype(int))
        renderer.remove(mesh)
    assert_alike(*pictures)


@pytest.mark.parametrize("output", ["lit", "depth"])
@pytest.mark.parametrize("as_fan", [True, False])
def test_a_picture_of_it_is_the_one_near_the_origin(knots, ctx, as_fan, output):
    subjects = [bake_fan(model, **FEW) if as_fan else model for model in knots]
    settings = PictureSettings(96, 96, output=output)
    assert_alike(*(draw_picture(ctx, each, orbit_camera(each, 0.3, 0.3, 1.0), settings) for each in subjects))


def test_a_comparison_measures_it_where_it_stands(knots, ctx):
    found = []
    for model in knots:
        comparison = Comparison(ctx, bake_fan(model, **FEW), model)
        found.append(next(comparison.rows([5], 2))[0])
        comparison.release()
    assert found[1].psnr_db == pytest.approx(found[0].psnr_db, abs=0.1)
    assert found[1].iou == pytest.approx(found[0].iou, abs=0.005)


def test_a_mesh_from_arrays_may_be_far_too():
    triangle = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
    model = Model.from_arrays(triangle + FAR, [[0, 1, 2]])
    np.testing.assert_array_equal(model.primitives[0].positions - FAR, triangle)
    assert isinstance(orbit_camera(model, 0, 0, 1.0), Camera)


def test_bounds_are_told_as_finely_as_the_object_is_large(knots):
    near, far = (np.array(_ranges(model.bounds)) for model in knots)
    np.testing.assert_allclose(far - FAR[:, None], near, atol=2e-5 * knots[0].radius)


def test_a_binary_ply_of_32_bits_is_told_too(tmp_path):
    path = tmp_path / "rounded.ply"
    corners = np.array([[0, 0, 0], [60, 0, 0], [0, 60, 0]], "<f4") + np.float32([4.2e6, 0, 0])
    header = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    header += "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    path.write_bytes(header.encode() + corners.tobytes() + b"\x03" + np.arange(3, dtype="<i4").tobytes())
    with pytest.warns(ModelWarning, match="0.5 m apart"):
        load_model(path)


def assert_alike(first, second):
    """Equal but for a few pixels on outlines."""
    apart = np.abs(first.astype(int) - second).reshape(len(first), len(first), -1).max(axis=-1)
    assert np.mean(apart > 3) < 0.01
    assert first.max() > first.min()
