"""What a caller gives that cannot be meant ends in one line, where it was given."""

import numpy as np
import pytest

import impostor
from bake.fan import bake_fan
from impostor.errors import ImpostorError, SettingsError
from impostor.lighting import DirectionalLight, LocalLight
from runtime import GroundSurface, ImpostorRenderer
from runtime.viewing.cameras import Camera
from tests.solids import Box, Sphere, solid_fan, solid_model

FAN, MODEL = solid_fan(Sphere(), views=6, size=32), solid_model(Box((-0.5, 0, -0.5), (0.5, 1.5, 0.5)))


def looking(eye=(0, 0, 1), target=(0, 0, 0), fov_deg=60, aspect=1, near=0.1, far=10):
    return Camera.perspective(eye, target, fov_deg, aspect, near, far)


def problem(call):
    with pytest.raises(ImpostorError) as caught:
        call()
    assert "\n" not in str(caught.value) and "expected" in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: impostor.load(None), "path: a NoneType; expected a str or a path"),
        (lambda: impostor.load(3), "path: a int; expected"),
        (lambda: impostor.load(b"tree.fan"), "path: a bytes; expected"),
        (lambda: impostor.load_model(None), "path: a NoneType; expected"),
        (lambda: impostor.load_ptm(None), "path: a NoneType; expected"),
        (lambda: impostor.load_environment(0), "path: a int; expected"),
        (lambda: impostor.save(None, FAN), "path: a NoneType; expected"),
        (lambda: impostor.save("never.fan", None), "fan: a NoneType; expected a Fan"),
        (lambda: impostor.save_ptm("wall", "never.ptm"), "ptm: a str; expected a Ptm"),
        (lambda: impostor.save_environment("never.hdr", None), "environment: a NoneType; expected an Environment"),
    ],
)
def test_files(call, message):
    assert problem(call).startswith(message)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"views": "a"}, "views: a str; expected a whole number from 1 to 2048"),
        ({"views": 4.0}, "views: 4.0; expected a whole number"),
        ({"views": True}, "views: True; expected a whole number"),
        ({"views": 0}, "views: 0; expected 1 to 2048"),
        ({"size": 64.5}, "size: 64.5; expected a whole number from"),
        ({"size": "64"}, "size: a str; expected a whole number from"),
        ({"samples": 1.5}, "samples: 1.5; expected 1, 2 or 4"),
        ({"distance": "far"}, "distance: a str; expected a distance above 0"),
        ({"distance": np.nan}, "distance: nan m; expected a distance above 0"),
        ({"elevation_deg": "up"}, "elevation: a str; expected a number of degrees"),
        ({"layout": 3}, "layout: 3; expected one of"),
    ],
)
def test_bakes(settings, message):
    assert problem(lambda: bake_fan(MODEL, **settings)).startswith(message)


def test_only_a_model_is_baked():
    assert problem(lambda: bake_fan(None)) == "model: a NoneType; expected a Model, as impostor.load_model gives"  # type: ignore[arg-type]


def test_numpys_whole_numbers_are_whole_numbers(tmp_path):
    fan = bake_fan(MODEL, views=np.int32(2), size=np.int64(16), samples=np.int8(1))  # type: ignore[arg-type]
    impostor.save(tmp_path / "box.fan", fan)
    assert impostor.load(tmp_path / "box.fan").settings["views"] == 2


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: looking(aspect=0), "camera: aspect 0; expected a number above 0"),
        (lambda: looking(aspect=np.inf), "camera: aspect inf; expected a number above 0"),
        (lambda: looking(eye="a"), "camera: eye is a str; expected numbers of shape (3,)"),
        (lambda: looking(eye=(0, np.nan, 1)), "camera: eye with a number that is not finite"),
        (lambda: looking(target=(0, 1)), "camera: target of shape (2,); expected (3,)"),
        (lambda: looking(fov_deg="wide"), "camera: fov_deg is a str; expected a finite number"),
        (lambda: looking(fov_deg=np.nan), "camera: fov_deg nan; expected a finite number"),
        (lambda: looking(near="a"), "camera: near is a str; expected a finite number"),
        (lambda: looking(far=np.inf), "camera: far inf; expected a finite number"),
        (lambda: Camera.orthographic((0, 0), 1, 0, 0), "camera: center of shape (2,); expected (3,)"),
        (lambda: Camera.orthographic((0, 0, 0), 0, 0, 0), "camera: radius 0; expected a number above 0"),
        (lambda: Camera.orthographic((0, 0, 0), 1, np.nan, 0), "camera: azimuth nan; expected a finite number"),
        (lambda: Camera.orthographic((0, 0, 0), 1, 0, "up"), "camera: elevation is a str; expected a finite number"),
        (lambda: Camera.orthographic((0, 0, 0), 1, 0, 0, -1), "camera: aspect -1; expected a number above 0"),
    ],
)
def test_cameras(call, message):
    assert problem(call).startswith(message)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"albedo": (1, 2, 3, 4)}, "ground surface: albedo of shape (4,); expected (3,)"),
        ({"albedo": (0.5, -0.1, 0.5)}, "ground surface: albedo goes down to -0.1; expected at least 0"),
        ({"albedo": "green"}, "ground surface: albedo is a str; expected numbers of shape (3,)"),
        ({"reach": -1}, "ground surface: reach -1; expected a number above 0"),
        ({"reach": np.nan}, "ground surface: reach nan; expected a number above 0"),
        ({"reach": 1e16}, "ground surface: reach 1e+16; expected a number above 0"),
        ({"tile": 0}, "ground surface: tile 0; expected a number above 0"),
        ({"middle": (0, 0)}, "ground surface: middle of shape (2,); expected (3,)"),
        ({"background": (0, 0, 0)}, "ground surface: background of shape (3,); expected (4,)"),
        ({"texture": "grass.png"}, "ground texture: a str; expected"),
    ],
)
def test_grounds(given, message):
    assert problem(lambda: GroundSurface(**given)).startswith(message)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: DirectionalLight.from_angles(3, 200), "light: elevation 200; expected a number from -90 to 90"),
        (lambda: DirectionalLight.from_angles(3, -90.5), "light: elevation -90.5; expected"),
        (lambda: DirectionalLight.from_angles("a", 20), "light: azimuth is a str; expected a finite number"),
        (lambda: DirectionalLight.from_angles(3, 20, (1, 1)), "light: colour (1, 1); expected three finite numbers"),
        (lambda: DirectionalLight.from_angles(3, 20, "red"), "light: colour red; expected three finite numbers"),
        (lambda: DirectionalLight("up"), "light: direction up; expected three finite numbers"),
        (lambda: DirectionalLight((1j, 0, 1)), "light: direction (1j, 0, 1); expected three finite numbers"),
        (lambda: DirectionalLight((0, 1, 0), softness="soft"), "light: softness is a str; expected a number"),
        (lambda: LocalLight("here"), "light: position here; expected three finite numbers"),
        (lambda: LocalLight((0, 1, 0), radius="small"), "light: radius is a str; expected a number"),
    ],
)
def test_lights(call, message):
    assert problem(call).startswith(message)


@pytest.mark.parametrize("name", ["positions", "yaws", "scales", "visible", "shares"])
def test_complex_numbers_are_no_places(renderer, name):
    copies = renderer.add(FAN, np.zeros((2, 3)))
    given = getattr(copies, name) + 0j
    assert problem(lambda: setattr(copies, name, given)) == f"solids: {name} of complex numbers; expected real ones"


@pytest.mark.parametrize("side", ["a", 0, -5, 2.5, 10**6, None, True, (256, 256), np.float64(256)])
def test_an_impossible_cache_is_refused_when_it_is_asked_for(ctx, side):
    with pytest.raises(SettingsError, match=r"^cache_side: .*; expected (a whole number from )?1 to \d+$"):
        ImpostorRenderer(ctx, cache_side=side)


def test_the_largest_cache_fits(ctx):
    """The message's largest side is one that the GPU can hold."""
    from runtime.fans.tiles import TileCache

    most = TileCache.largest(ctx)
    limit = ctx.info["GL_MAX_TEXTURE_SIZE"]
    assert most + most // 64 <= limit < most + 1 + (most + 1) // 64
    ImpostorRenderer(ctx, cache_side=np.int64(most)).release()


def test_only_a_context_is_one():
    assert problem(lambda: ImpostorRenderer(None)) == "ctx: a NoneType; expected a Context of moderngl"  # type: ignore[arg-type]
