"""A bake from a model file: the same bytes each time, any shape and size of object, and shadows that hold up."""

import subprocess

import numpy as np
import pytest
from PIL import Image, ImageDraw

from bake.fan import bake_fan
from impostor.files.fan_file import read_fan, validate_fan
from impostor.model import SUFFIXES, load_model
from impostor.shadow_projection import Ground, Quad, along_light, shadow_on_ground
from impostor.strips import silhouette_strips
from impostor.views import direction
from tests.data import DATA, SAMPLES, needs_data
from tests.end_to_end.commands import (
    COMMAND,
    CUBE,
    CUBE_FACES,
    SMALL,
    SQUARE,
    SQUARE_FACES,
    baked,
    json_of,
    overlap,
    rendered,
    run,
    write_obj,
)

LEVEL = Ground(np.array([0.0, 1.0, 0.0]))
TRIANGLE = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
LYING = [[0, 0, 0], [1, 0, 0], [1, 0, -1], [0, 0, -1]]


# --- the same bytes


@pytest.mark.parametrize("name", ["house.glb", "knot.stl"])
def test_the_same_model_gives_the_same_bytes(tmp_path, name):
    first = baked(SAMPLES / name, tmp_path / "a.fan").read_bytes()
    assert baked(SAMPLES / name, tmp_path / "b.fan").read_bytes() == first
    arguments = ["bake", SAMPLES / name, "-o", tmp_path / "c.fan", *SMALL]
    subprocess.run([COMMAND, *map(str, arguments)], check=True)
    assert (tmp_path / "c.fan").read_bytes() == first


def test_another_model_or_setting_gives_other_bytes(tmp_path):
    cube = write_obj(tmp_path / "a.obj", CUBE, CUBE_FACES)
    first = baked(cube, tmp_path / "a.fan").read_bytes()
    assert baked(cube, tmp_path / "b.fan", *SMALL, "--elevation", 16).read_bytes() != first
    (tmp_path / "a.obj").write_text(cube.read_text() + "# by hand\n")
    assert baked(cube, tmp_path / "c.fan").read_bytes() != first


# --- every model


@pytest.mark.parametrize("name", sorted(path.name for path in SAMPLES.glob("*.???") if path.suffix in SUFFIXES))
def test_every_sample_model(tmp_path, capsys, name):
    check_bake(SAMPLES / name, tmp_path, capsys)


@needs_data
@pytest.mark.parametrize(
    "name",
    ["Duck.glb", "duck_draco/Duck.gltf", "fuze/fuze.obj", "capsule/capsule.obj", "featuretype.STL", "Fox.glb",
     "cycloidal_vertex_colors.ply", "utah_teapot.obj", "CesiumMilkTruck.glb"],
)  # fmt: skip
def test_real_models(tmp_path, capsys, name):
    check_bake(DATA / "models" / name, tmp_path, capsys)


def check_bake(path, folder, capsys):
    """A sound fan that looks like its mesh where it was baked from; a warning is all that may be said."""
    fan = baked(path, folder / "a.fan", "--views", 4, "--size", 64)
    assert validate_fan(fan) == []
    flags = ("--size", "64x64", "--output", "alpha")
    masks = [rendered(subject, folder / "a.png", *flags) >= 128 for subject in (fan, path)]
    assert overlap(*masks) > 0.9  # measured: 0.93 for the lattice of thin struts, 0.95 and more for the others
    out, err = capsys.readouterr()
    assert out == ""
    assert all(line.startswith("impostor: warning: ") for line in err.splitlines())


# --- odd objects and odd numbers


@pytest.mark.parametrize("scale", [1e6, 1e-6])
def test_the_size_of_an_object_does_not_matter(tmp_path, scale):
    models = [write_obj(tmp_path / f"{s}.obj", np.array(CUBE) * s, CUBE_FACES) for s in (1.0, scale)]
    one, other = (read_fan(baked(model, tmp_path / "a.fan")) for model in models)
    np.testing.assert_allclose(other.bounds, one.bounds * scale, rtol=1e-5)
    np.testing.assert_allclose(other.views.radius, one.views.radius * scale, rtol=1e-5)
    assert np.array_equal(other.silhouette, one.silhouette)
    assert np.mean(other.normal[0] != one.normal[0]) < 0.01
    flags = ("--size", "48x48", "--azimuth", 30)
    pictures = [rendered(model, tmp_path / "a.png", *flags) for model in models]
    assert np.abs(pictures[0] - pictures[1]).mean() < 1


def test_an_object_far_from_the_origin_is_seen_as_near(tmp_path):
    far = np.array([1000.0, 500.0, -300.0])
    models = [
        write_obj(tmp_path / f"{name}.obj", np.add(CUBE, at), CUBE_FACES) for name, at in (("near", 0), ("far", far))
    ]
    one, other = (read_fan(baked(model, tmp_path / "a.fan")) for model in models)
    np.testing.assert_allclose(other.views.center, one.views.center + far, atol=1e-3)
    assert np.mean(other.silhouette != one.silhouette) < 0.01
    fan = baked(models[1], tmp_path / "far.fan", "--views", 4, "--size", 64)
    flags = ("--size", "64x64", "--azimuth", 90, "--output", "alpha")
    masks = [rendered(subject, tmp_path / "a.png", *flags) >= 128 for subject in (fan, models[1])]
    assert overlap(*masks) > 0.97


@pytest.mark.parametrize(
    ("positions", "faces", "elevation"),
    [(SQUARE, SQUARE_FACES, 15), (LYING, SQUARE_FACES, 60), (TRIANGLE, [[0, 1, 2]], 15)],
    ids=["upright square", "lying square", "triangle"],
)
def test_flat_objects(tmp_path, positions, faces, elevation):
    model = write_obj(tmp_path / "flat.obj", positions, faces)
    fan = baked(model, tmp_path / "flat.fan", "--views", 4, "--size", 64, "--elevation", elevation)
    assert validate_fan(fan) == []
    flags = ("--size", "64x64", "--azimuth", 180, "--elevation", elevation, "--output", "alpha")
    masks = [rendered(subject, tmp_path / "a.png", *flags) >= 128 for subject in (fan, model)]
    assert overlap(*masks) > 0.95


@pytest.mark.parametrize(("views", "size"), [(1, 33), (3, 100), (7, 9), (2, 250)])
def test_any_count_and_size(tmp_path, views, size):
    cube = write_obj(tmp_path / "cube.obj", CUBE, CUBE_FACES)
    path = baked(cube, tmp_path / "a.fan", "--views", views, "--size", size)
    assert validate_fan(path) == []
    fan = read_fan(path)
    assert fan.color.shape == (views, size, size, 4)
    level = fan.normal[-1].shape[-1]
    assert level << (len(fan.normal) - 1) == size
    assert level % 2 or level < 8  # halved as long as whole texels allow
    flags = ("--size", "100x100", "--output", "alpha")
    masks = [rendered(subject, tmp_path / "a.png", *flags) >= 128 for subject in (path, cube)]
    assert overlap(*masks) > 1 - 4 / size


@pytest.mark.parametrize("layout", ["hemisphere", "sphere"])
def test_layouts_see_the_object_from_where_they_stand(tmp_path, layout):
    path = baked(SAMPLES / "house.glb", tmp_path / "a.fan", "--views", 12, "--size", 64, "--layout", layout)
    backs = read_fan(path).views.basis[:, 2]
    assert backs[:, 1].max() > 0.85
    assert backs[:, 1].min() > 0 if layout == "hemisphere" else backs[:, 1].min() < -0.85
    for back in backs[[0, 5, 11]]:
        azimuth, elevation = np.degrees([np.arctan2(back[0], back[2]), np.arcsin(back[1])])
        flags = ("--size", "64x64", "--azimuth", azimuth, "--elevation", elevation, "--output", "alpha")
        masks = [rendered(s, tmp_path / "a.png", *flags) >= 128 for s in (path, SAMPLES / "house.glb")]
        assert overlap(*masks) > 0.97


def test_a_perspective_fan_is_what_its_camera_saw(tmp_path, capsys):
    cube = write_obj(tmp_path / "cube.obj", CUBE, CUBE_FACES)
    path = baked(cube, tmp_path / "a.fan", "--views", 8, "--size", 96, "--perspective", 3, "--elevation", 20)
    assert json_of(capsys, "info", path, "--json")["camera"] == "perspective at 3 m"
    eye = 0.5 + 3 * direction(np.pi / 4, np.radians(20))
    flags = ("--size", "96x96", "--eye", ",".join(map(str, eye)), "--fov", 35, "--output", "alpha")
    masks = [rendered(subject, tmp_path / "a.png", *flags) >= 128 for subject in (path, cube)]
    assert overlap(*masks) > 0.97


# --- shadows


@pytest.fixture(scope="module", params=["statue.glb", "lattice.glb"])
def caster(request):
    model = load_model(SAMPLES / request.param)
    return request.param, model, bake_fan(model, views=24, size=128)


@pytest.mark.parametrize(
    ("light_deg", "floors"),
    # Measured, statue and lattice: 0.956, 0.876 at a baked view's direction; 0.941, 0.841 halfway between two views;
    # 0.931, 0.825 thirty degrees above the ring.
    [((30, 15), (0.94, 0.85)), ((37.5, 15), (0.92, 0.81)), ((30, 45), (0.91, 0.80))],
)
def test_the_shadow_of_strips_is_the_shadow_of_the_mesh(caster, light_deg, floors):
    name, model, fan = caster
    light = direction(*np.radians(light_deg))
    seen, shown = int(fan.views.nearest(light)), fan.views[3]
    strips = silhouette_strips(fan.silhouette[seen])
    shadow = shadow_on_ground(
        strips, fan.views[seen], fan.depth[seen], shown, Quad.unturned(shown, np.eye(4)), world_from_model=np.eye(4),
        toward_light=light, eye=np.append(shown.basis[2], 0), ground=LEVEL, feet=0.1,
    )  # fmt: skip
    truth = [along_light(part.positions.astype(float), light, LEVEL) for part in model.primitives]
    corners = np.concatenate(truth)
    frame = corners.min(axis=0) - 0.1, corners.max(axis=0) + 0.1
    wanted = [filled(points, part.triangles, frame) for points, part in zip(truth, model.primitives, strict=True)]
    found = filled(shadow[:, :3] / shadow[:, 3:], strips.triangles(), frame)
    assert overlap(np.logical_or.reduce(wanted), found) > floors[name == "lattice.glb"]


def filled(points, triangles, frame, side=1024):
    """Triangles on the ground as a mask of their x and z."""
    image = Image.new("1", (side, side))
    draw = ImageDraw.Draw(image)
    low, high = frame
    places = ((points - low) / (high - low) * side - 0.5)[:, [0, 2]]
    for corners in places[triangles].reshape(-1, 6).tolist():
        draw.polygon(corners, fill=1)
    return np.asarray(image)


@pytest.mark.parametrize(("light", "floor"), [("75,25", 0.9), ("45,45", 0.77)])  # measured: 0.94 and 0.83
def test_the_shadow_in_a_picture_is_that_of_the_mesh(tmp_path, light, floor):
    model = SAMPLES / "statue.glb"
    fan = baked(model, tmp_path / "a.fan", "--views", 24, "--size", 128)
    # From far away, almost where view 0 stands.
    flags = ("--size", "240x240", "--eye", "0,52.4,193", "--target", "-0.8,0.6,0", "--fov", 1.2, "--light", light)
    shadows = []
    for subject in (fan, model):
        lit = rendered(subject, tmp_path / "a.png", *flags, "--ambient", 0.1)[..., 0]
        alone = rendered(subject, tmp_path / "a.png", *flags, "--output", "alpha")
        shadows.append((lit < 0.7 * np.median(lit)) & (alone == 0))
    assert np.count_nonzero(shadows[1]) > 500
    assert overlap(*shadows) > floor


def test_no_command_changes_the_model(tmp_path):
    model = write_obj(tmp_path / "cube.obj", CUBE, CUBE_FACES)
    before = model.read_bytes()
    fan = baked(model, tmp_path / "a.fan")
    assert run("compare", fan, model, "--offsets", 0, "--cameras", 1, "--quiet") == 0
    assert model.read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.fan", "cube.obj"]
