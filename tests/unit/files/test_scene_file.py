"""Scene files: what is written is placed."""

import shutil
import warnings

import numpy as np
import pytest
from PIL import Image

from impostor.environment import Environment, Reflection
from impostor.errors import SceneWarning
from impostor.files.baked_fans import baked_fan_path
from impostor.files.scene_file import load_scene
from impostor.scene import BakeSettings, Subject
from impostor.srgb import linear_from_srgb
from impostor.views import direction, rotation_about_y
from tests.data import ROOT, SAMPLES
from tests.scene_files import CAMERA, fill, load, refused, table

SCENES = sorted((ROOT / "scenes").glob("*.toml"))


@pytest.fixture
def folder(tmp_path):
    return fill(tmp_path)


def test_the_shortest_scene_has_a_light(folder):
    scene = load(folder, CAMERA)
    assert scene.camera.eye == (0, 1, 5) and scene.camera.fov_deg == 50
    assert len(scene.lights) == 1 and scene.ambient == (0.25, 0.25, 0.25)
    assert scene.sun is scene.ground is scene.background is None
    assert not (scene.instances or scene.meshes or scene.surfaces)


def test_a_sun_or_a_light_takes_the_place_of_the_default_light(folder):
    lit = load(folder, table("azimuth_deg = 30\nelevation_deg = 60\ncolor = [2, 1, 0]", "[[light]]"))
    (light,) = lit.lights
    np.testing.assert_allclose(light.toward, direction(np.radians(30), np.radians(60)))
    assert light.color == (2, 1, 0)
    sunny = load(folder, table("latitude_deg = 60\nnorth_deg = 90\nhours_per_second = -0.5", "[sun]"))
    assert sunny.lights == () and sunny.ambient == (0, 0, 0)
    assert np.degrees((sunny.sun.latitude, sunny.sun.north)) == pytest.approx((60, 90))
    assert (sunny.sun.time_of_day, sunny.sun.hours_per_second) == (12, -0.5)


def test_colors_are_linear_numbers_one_grey_or_srgb(folder):
    scene = load(folder, f'ambient = [0.1, 0.2, 0.3]\nbackground = "#ff8000"\n{CAMERA}[ground]\nalbedo = 0.4\n')
    assert scene.ambient == (0.1, 0.2, 0.3)
    np.testing.assert_allclose(scene.background, linear_from_srgb([1, 128 / 255, 0]))
    assert scene.ground.albedo == (0.4, 0.4, 0.4)


def test_an_instance_of_a_fan(folder):
    keys = 'fan = "a.fan"\nposition = [1, 2, 3]\nyaw_deg = 90\nscale = 2\ngloss = 0.3\nshininess = 8'
    (placement,) = load(folder, table(keys, "[[instance]]")).instances
    assert placement.subject == Subject(folder / "a.fan") and not placement.lod
    assert placement.positions.tolist() == [[1, 2, 3]]
    assert placement.yaws == pytest.approx([np.pi / 2]) and placement.scales.tolist() == [2]
    assert (placement.gloss.strength, placement.gloss.shininess) == (0.3, 8)
    assert placement.positions.dtype == placement.yaws.dtype == placement.scales.dtype == np.float64


def test_a_models_fan_is_named_for_what_it_is_baked_of(folder):
    keys = 'model = "a.glb"\nlod = true\nup = "z"\nbake = { views = 40, layout = "sphere", samples = 4 }'
    (placement,) = load(folder, table(keys, "[[instance]]")).instances
    settings = BakeSettings(40, None, "sphere", 256, 4, "z")
    assert placement.lod
    assert placement.subject.bake == settings and placement.subject.model == folder / "a.glb"
    assert placement.subject.fan == baked_fan_path(folder, folder / "a.glb", settings)
    assert placement.subject.fan.parent == folder / "baked_fans" and not placement.subject.fan.exists()


def test_a_fan_beside_its_mesh(folder):
    (placement,) = load(folder, table('fan = "a.fan"\nmodel = "a.glb"\nlod = true', "[[instance]]")).instances
    assert placement.subject == Subject(folder / "a.fan", folder / "a.glb")


def test_copies_of_one_subject_are_one_placement_whatever_path_names_it(folder):
    subjects = ["a.glb", "deep/../a.glb", "b.glb", str(folder / "a.glb")]
    text = CAMERA + "".join(
        f'[[instance]]\nmodel = "{name}"\nposition = [{x}, 0, 0]\n' for x, name in enumerate(subjects)
    )
    text += '[[instance]]\nmodel = "a.glb"\ngloss = 1\n'
    shared, other, glossy = load(folder, text).instances
    assert shared.positions[:, 0].tolist() == [0, 1, 3]
    assert (len(other), len(glossy)) == (1, 1) and glossy.subject == shared.subject != other.subject


def test_two_numbers_stand_on_the_ground(folder):
    """The ground falls toward +X by 45 degrees, from 3 m at the origin."""
    text = """
    [camera]
    eye = [2, 0]
    target = [0, 0, 0]
    walking_height = 2
    [ground]
    height = 3
    tilt_deg = 45
    tilt_azimuth_deg = 90
    [[instance]]
    model = "a.glb"
    position = [10, 7]
    [[mesh]]
    model = "a.glb"
    position = [-4, 0]
    [[surface]]
    ptm = "a.ptm"
    width = 1
    height = 6
    position = [0, 0]
    [[scatter]]
    model = "b.glb"
    count = 50
    rectangle = [0, 0, 20, 20]
    """
    scene = load(folder, text)
    assert scene.camera.eye == pytest.approx((2, 3, 0))
    by_name = {placement.subject.model.name: placement.positions for placement in scene.instances}
    assert by_name["a.glb"][0] == pytest.approx((10, -7, 7))
    x, y, _ = by_name["b.glb"].T
    np.testing.assert_allclose(y, 3 - x)
    assert scene.meshes[0].position == pytest.approx((-4, 7, 0))
    assert scene.surfaces[0].position == pytest.approx((0, 6, 0))
    plane = scene.ground.plane
    np.testing.assert_allclose(by_name["b.glb"] @ plane.normal, plane.offset)


def test_without_ground_two_numbers_stand_at_zero(folder):
    (placement,) = load(folder, table('model = "a.glb"\nposition = [4, 5]', "[[instance]]")).instances
    assert placement.positions.tolist() == [[4, 0, 5]]


def test_a_mesh_is_turned_and_scaled_about_its_origin(folder):
    keys = 'model = "deep/c.obj"\nposition = [1, 2, 3]\nyaw_deg = 90\nscale = 2\nup = "z"'
    (mesh,) = load(folder, table(keys, "[[mesh]]")).meshes
    assert (mesh.model, mesh.up) == (folder / "deep/c.obj", "z")
    np.testing.assert_allclose(mesh.world_from_model @ (0, 0, 1, 1), (3, 2, 3, 1), atol=1e-12)


@pytest.mark.parametrize(("yaw_deg", "pitch_deg"), [(0, 0), (90, 0), (-120, 30), (10, 90), (0, -90)])
def test_a_surface_faces_its_azimuth_and_elevation(folder, yaw_deg, pitch_deg):
    keys = f'ptm = "a.ptm"\nwidth = 2\nheight = 3\ntiling = [4, 5]\nyaw_deg = {yaw_deg}\npitch_deg = {pitch_deg}'
    (surface,) = load(folder, table(keys, "[[surface]]")).surfaces
    matrix = surface.world_from_model[:3, :3]
    np.testing.assert_allclose(matrix[:, 2], direction(*np.radians([yaw_deg, pitch_deg])), atol=1e-12)
    np.testing.assert_allclose(matrix[:, 0], rotation_about_y(np.radians(yaw_deg))[:, 0], atol=1e-12)
    assert np.linalg.det(matrix) == pytest.approx(1)
    assert (surface.width, surface.height, surface.tiling) == (2, 3, (4, 5))


def scattered(folder, keys):
    (placement,) = load(folder, table(f'model = "a.glb"\n{keys}', "[[scatter]]")).instances
    return placement


def test_scattered_copies_lie_in_their_area_turned_and_scaled_anyhow(folder):
    copies = scattered(folder, "count = 4000\nrectangle = [-3, 10, 5, 12]\nscale = [0.5, 2]\nseed = 3")
    x, y, z = copies.positions.T
    assert (x.min() >= -3) and (x.max() <= 5) and (z.min() >= 10) and (z.max() <= 12) and not y.any()
    assert np.histogram(copies.yaws, 4, (0, 2 * np.pi))[0] == pytest.approx([1000] * 4, abs=150)
    assert np.histogram(copies.scales, 3, (0.5, 2))[0] == pytest.approx([4000 / 3] * 3, abs=150)


def test_scales_and_yaws_can_be_changed_without_moving_a_copy(folder):
    keys = "count = 100\ncircle = [0, 0, 9]\nminimum_distance = 0.3\n"
    one, other = scattered(folder, keys), scattered(folder, f"{keys}scale = 3\nyaw_deg = -90")
    np.testing.assert_array_equal(one.positions, other.positions)
    assert set(other.scales) == {3} and set(np.degrees(other.yaws)) == {-90} and set(one.scales) == {1}
    again = scattered(folder, f"{keys}scale = [1, 2]")
    np.testing.assert_array_equal(one.yaws, again.yaws)


@pytest.mark.parametrize("mode", ["L", "1", "RGB", "RGBA", "LA", "P", "I;16"])
def test_a_density_picture_has_its_top_toward_minus_z(folder, mode):
    grey = np.zeros((4, 4), np.uint8)
    grey[0, 2:] = 255
    picture = Image.fromarray(grey.astype(np.uint16) * 257) if mode == "I;16" else Image.fromarray(grey).convert(mode)
    picture.save(folder / "d.png")
    copies = scattered(folder, 'count = 200\nrectangle = [-8, -8, 8, 8]\ndensity = "d.png"')
    x, _, z = copies.positions.T
    assert len(x) == 200 and x.min() >= 0 and z.max() <= -4


def test_sixteen_bits_of_density_are_kept(folder):
    Image.fromarray(np.array([[65535, 6554]], np.uint16)).save(folder / "d.png")
    copies = scattered(folder, 'count = 2200\nrectangle = [-8, -8, 8, 8]\ndensity = "d.png"')
    assert (copies.positions[:, 0] > 0).sum() == pytest.approx(200, abs=60)


def test_a_full_area_is_told_of(folder):
    text = table('model = "a.glb"\ncount = 500\ncircle = [0, 0, 5]\nminimum_distance = 2', "[[scatter]]")
    with pytest.warns(SceneWarning, match=r"line 7: scatter\[0\].count: 500 copies; \d\d of them found room"):
        (placement,) = load(folder, text).instances
    assert 5 < len(placement) < 30


def test_a_flight(folder):
    keys = [(0, [0, 2], [0, 0, 0]), (2.5, [3, 4, 5], [1, 0, 0]), (3, [3, 9, 5], [0, 1, 0])]
    text = "[camera]\n" + "".join(f"[[camera.path]]\ntime={t}\neye={eye}\ntarget={to}\n" for t, eye, to in keys)
    camera = load(folder, text).camera
    assert camera.path.times.tolist() == [0, 2.5, 3] and camera.path.duration == 3
    assert camera.path.eyes[:2].tolist() == [[0, 1.7, 2], [3, 4, 5]]
    assert camera.path.targets.tolist() == [to for _, _, to in keys]
    assert camera.eye == (0, 1.7, 2) and camera.target == (0, 0, 0)


def test_arrays_cannot_be_written(folder):
    scene = load(folder, table('model = "a.glb"', "[[instance]]"))
    for array in (scene.instances[0].positions, scene.instances[0].yaws, scene.instances[0].scales):
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 0


def test_every_file_is_listed_with_the_parts_made_of_it(folder):
    Image.new("L", (2, 2), 255).save(folder / "d.png")
    text = f"""{CAMERA}
    [ground]
    texture = "a.png"
    [[scatter]]
    model = "a.glb"
    count = 3
    circle = [0, 0, 5]
    density = "d.png"
    [[instance]]
    fan = "a.fan"
    [[mesh]]
    model = "a.glb"
    [[surface]]
    ptm = "a.ptm"
    width = 1
    height = 1
    """
    assert load(folder, text).files == {
        folder / "s.toml": frozenset(),
        folder / "a.png": {"ground"},
        folder / "a.glb": {"instances", "meshes"},
        folder / "d.png": {"instances"},
        folder / "a.fan": {"instances"},
        folder / "a.ptm": {"surfaces"},
    }


def test_rooms_stand_on_the_ground_and_turn_with_time(folder):
    text = f"""{CAMERA}
    [ground]
    height = 2
    [[room]]
    environment = "a.hdr"
    turn_deg = 90
    [[room]]
    environment = "faces"
    shape = "box"
    size = [4, 3, 6]
    position = [1, -1]
    yaw_deg = 90
    visible = false
    [[room]]
    shape = "sphere"
    radius = 5
    """
    far, box, sphere = load(folder, text).rooms
    assert far.environment == folder / "a.hdr" and far.turn == pytest.approx(np.pi / 2)
    assert box.environment == folder / "faces" and not box.visible and box.position == (1, 3.5, -1)
    grey = Environment("grey", np.ones((6, 8, 8, 3), np.float32))
    corner = box.around(grey, box.yaw).world_from_room @ (1, 1, 1, 1)
    np.testing.assert_allclose(corner[:3], (1 + 3, 3.5 + 1.5, -1 - 2), atol=1e-12)
    assert sphere.environment is None and sphere.position == (0, 7, 0)
    assert np.linalg.norm(sphere.around(grey, 0.0).world_from_room[:3, 0]) == 5


def test_a_room_is_the_light_where_nothing_else_is_said(folder):
    scene = load(folder, f'{CAMERA}\n[[room]]\nenvironment = "a.hdr"')
    assert scene.lights == () and scene.ambient == (0, 0, 0) and scene.contact_shadow == 1
    assert scene.files[folder / "a.hdr"] == {"rooms"}


def test_what_mirrors_alike_is_one_placement(folder):
    text = f"""{CAMERA}
    [[instance]]
    model = "a.glb"
    reflection = {{ metal = 1 }}
    [[scatter]]
    model = "a.glb"
    count = 5
    circle = [0, 0, 5]
    reflection = {{ metal = 1 }}
    [[instance]]
    model = "a.glb"
    [[mesh]]
    model = "b.glb"
    reflection = {{}}
    """
    scene = load(folder, text)
    assert [len(each) for each in scene.instances] == [6, 1]
    assert scene.instances[0].reflection == Reflection(metal=1) and scene.instances[1].reflection is None
    assert scene.meshes[0].reflection == Reflection()


def test_byte_order_mark_and_windows_line_ends(folder):
    text = "\ufeff" + table('model = "a.glb"\nscal = 1', "[[instance]]").replace("\n", "\r\n")
    assert refused(folder, text) == "line 7: instance[0].scal: unknown key; expected 'scale'"
    load(folder, "\ufeff" + CAMERA.replace("\n", "\r\n"))


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_the_shipped_scenes_load(path, tmp_path):
    """The PTM is made by the user's own command: any file stands for it here."""
    shutil.copytree(path.parent, tmp_path / "scenes")
    (tmp_path / "sample_models").mkdir()
    for model in SAMPLES.iterdir():
        (tmp_path / "sample_models" / model.name).symlink_to(model)
    ptm = tmp_path / "sample_models" / "rosette.ptm"
    if not ptm.exists():
        ptm.touch()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = load_scene(tmp_path / "scenes" / path.name)
    assert scene.instances and scene.ground


def test_scenes_are_shipped():
    assert {path.stem for path in SCENES} == {"forest", "square", "close", "study", "meadow", "day"}
