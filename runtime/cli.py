"""`impostor render` and `impostor compare`."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from impostor.commands import (
    AllowMissing,
    AsJson,
    BakedUpAxis,
    Force,
    Quiet,
    UpAxis,
    as_flags,
    check_name,
    progress_bar,
    refuse_with_fan,
)
from impostor.errors import ModelError, ModelWarning, SettingsError

if TYPE_CHECKING:
    import moderngl

    from impostor.environment import Reflection
    from impostor.fan import Fan
    from impostor.lighting import DirectionalLight, Gloss
    from impostor.model import Model
    from runtime.viewing.cameras import Camera

METHODS = ("nearest",)
MAX_SIDE = 16384

Lights = Annotated[
    list[str] | None, typer.Option("--light", metavar="AZ,EL[,R,G,B]", help="A directional light; repeatable.")
]
Method = Annotated[str, typer.Option(metavar="nearest", help="How views between the views are made.")]


def register(app: typer.Typer) -> None:
    """Add this stage's commands."""
    from runtime.walk.cli import walk

    app.command("render")(render)
    app.command("compare")(compare)
    app.command("walk")(walk)


@as_flags("output", fov_deg="--fov")
def render(
    subject: Annotated[Path, typer.Argument(metavar="FAN|MODEL|SCENE")],
    output_file: Annotated[Path, typer.Option("-o", metavar="OUT.png")],
    size: Annotated[str, typer.Option(metavar="WxH")] = "512x512",
    azimuth: Annotated[float | None, typer.Option(metavar="DEG", help="Of an orthographic camera; 0.")] = None,
    elevation: Annotated[float | None, typer.Option(metavar="DEG", help="Of an orthographic camera; 15.")] = None,
    eye: Annotated[str | None, typer.Option(metavar="X,Y,Z", help="Of a perspective camera.")] = None,
    target: Annotated[str | None, typer.Option(metavar="X,Y,Z", help="The object's middle if left out.")] = None,
    fov: Annotated[float | None, typer.Option(metavar="DEG", help="Vertical field of view; 40.")] = None,
    light: Lights = None,
    ambient: Annotated[float | None, typer.Option(metavar="A", help="Linear light that reaches everything.")] = None,
    gloss: Annotated[str | None, typer.Option(metavar="STRENGTH,SHININESS", help="A highlight.")] = None,
    environment: Annotated[
        Path | None, typer.Option(metavar="MAP", help="Light from all around, instead of the default light.")
    ] = None,
    exposure: Annotated[float | None, typer.Option(metavar="F", help="Multiplies the environment's light.")] = None,
    reflection: Annotated[
        str | None, typer.Option(metavar="LEAST,ROUGHNESS,METAL", help="What it mirrors of the environment.")
    ] = None,
    method: Method = "nearest",
    output: Annotated[str, typer.Option(metavar="lit|albedo|normal|depth|alpha")] = "lit",
    no_shadow: Annotated[bool, typer.Option("--no-shadow", help="No ground and no shadow.")] = False,
    background: Annotated[
        str | None, typer.Option(metavar="R,G,B|transparent", help="sRGB, 0 to 1, behind a lit picture.")
    ] = None,
    up: UpAxis = None,
    allow_missing_textures: AllowMissing = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Draw a fan, a mesh through the same camera and lights, or what a scene's camera sees first, as a PNG."""
    if subject.suffix.lower() == ".toml":
        from runtime.walk.cli import render_scene

        of_one_object = {"--light": light, "--ambient": ambient, "--gloss": gloss, "--background": background}
        of_one_object |= {"--environment": environment, "--reflection": reflection, "--exposure": exposure}
        of_one_object |= {"--azimuth": azimuth, "--elevation": elevation, "--up": up}
        of_one_object |= {"--allow-missing-textures": allow_missing_textures or None}
        for flag, value in of_one_object.items():
            if value is not None:
                raise SettingsError(flag, f"given with {subject}; expected it with a fan or a model, not with a scene")
        given = {"eye": eye and _numbers("--eye", eye, 3), "target": target and _numbers("--target", target, 3)}
        camera = {**given, "fov_deg": fov}
        render_scene(subject, output_file, _size(size), output, not no_shadow, camera, force, quiet)
        return
    from impostor.files.pictures import save_png
    from runtime.pictures import PictureSettings, draw_picture

    width, height = _size(size)
    _check_method(method)
    options: dict[str, Any] = {"output": output, "shadow": not no_shadow}
    if environment is not None:
        options |= {"lights": (), "ambient": 0.0}
    if exposure is not None and (environment is None or not 0 < exposure < math.inf):
        raise SettingsError("--exposure", f"{exposure:g}; expected a number above 0, with --environment")
    if reflection is not None:
        options["reflection"] = _reflection(reflection, environment)
    if light:
        options["lights"] = tuple(_light(text) for text in light)
    if ambient is not None:
        if not 0 <= ambient < math.inf:
            raise SettingsError("--ambient", f"{ambient:g}; expected a number of at least 0")
        options["ambient"] = ambient
    if gloss is not None:
        options["gloss"] = _gloss(gloss)
    if background is not None:
        options["background"] = _background(background)
    settings = PictureSettings(width, height, **options)
    viewpoint = _viewpoint(azimuth, elevation, eye, target, fov)
    check_name(output_file, ".png", force)
    loaded = _load(subject, up, allow_missing_textures)
    if environment is not None:
        from impostor.environment import Room
        from impostor.files.environment_file import read_environment

        settings = replace(
            settings, rooms=[Room.far(read_environment(environment), exposure=1.0 if exposure is None else exposure)]
        )
    with _context() as ctx:
        pixels = draw_picture(ctx, loaded, viewpoint(loaded, width / height), settings)
    save_png(output_file, pixels, force=force)


@as_flags(offsets_deg="--offsets")
def compare(
    fan_file: Annotated[Path, typer.Argument(metavar="FAN")],
    model_file: Annotated[Path, typer.Argument(metavar="MODEL")],
    as_json: AsJson = False,
    offsets: Annotated[
        str, typer.Option(metavar="DEG,...", help="Camera elevations relative to the fan's.")
    ] = "0,5,10,20,35",
    cameras: Annotated[int, typer.Option(help="Cameras around the object, all between baked views.")] = 8,
    method: Method = "nearest",
    size: Annotated[int | None, typer.Option(metavar="PIXELS", help="Side of the pictures; the tiles' side.")] = None,
    light: Lights = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="PNG", help="Write mesh, impostor and difference side by side.")
    ] = None,
    up: BakedUpAxis = None,
    allow_missing_textures: AllowMissing = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Measure a fan against its mesh from cameras between the baked views."""
    from impostor.files.fan_file import read_fan
    from impostor.files.pictures import save_png
    from impostor.model import load_model
    from runtime.compare import Comparison, side_by_side
    from runtime.compare import as_json as rows_as_json
    from runtime.fans.lod import check_same_object
    from runtime.lights.settings import DEFAULT_LIGHTS

    _check_method(method)
    angles = _numbers("--offsets", offsets)
    if not 1 <= cameras <= 360:
        raise SettingsError("--cameras", f"{cameras}; expected 1 to 360")
    if size is not None and not 16 <= size <= 4096:
        raise SettingsError("--size", f"{size} pixels; expected 16 to 4096")
    lights = tuple(_light(text) for text in light) if light else DEFAULT_LIGHTS
    if picture is not None:
        check_name(picture, ".png", force)
    fan = read_fan(fan_file)
    axis = up or str(fan.settings.get("up", "y"))
    model = load_model(model_file, up=axis, allow_missing_textures=allow_missing_textures)
    if fan.source.get("sha256") not in (None, model.source_hash):
        baked_from = f"{fan_file} was baked from another ({fan.source.get('name')})"
        warnings.warn(f"{model_file}: is not what the fan shows: {baked_from}", ModelWarning, stacklevel=1)
    try:
        check_same_object(fan, model)
    except SettingsError as error:
        raise ModelError(model_file, f"is not what {fan_file} shows: {error.problem}") from None
    with _context() as ctx, progress_bar("comparing", quiet) as progress:
        comparison = Comparison(ctx, fan, model, size, lights)
        try:
            measured = list(comparison.rows(angles, cameras, progress))
        finally:
            comparison.release()
    rows = [row for row, _ in measured]
    if picture is not None:
        save_png(picture, side_by_side([pair for _, pair in measured]), force=force)
    if as_json:
        print(json.dumps(rows_as_json(rows), indent=2))
        return
    print(f"{'method':10} {'offset':>7} {'PSNR dB':>8} {'SSIM':>7} {'FLIP':>7} {'IoU':>7}")
    for row in rows:
        values = f"{row.psnr_db:8.2f} {row.ssim:7.4f} {row.flip:7.4f} {row.iou:7.4f}"
        print(f"{row.method:10} {row.offset_deg:7g} {values}")


@contextmanager
def _context() -> Iterator[moderngl.Context]:
    """A context for one command."""
    from runtime.gl.context import make_context

    ctx = make_context()
    try:
        yield ctx
    finally:
        ctx.release()


def _load(path: Path, up: str | None, allow_missing_textures: bool) -> Fan | Model:
    if path.suffix.lower() == ".fan":
        refuse_with_fan(path, up=up, allow_missing_textures=allow_missing_textures)
        from impostor.files.fan_file import read_fan

        return read_fan(path)
    from impostor.model import load_model

    return load_model(path, up=up or "y", allow_missing_textures=allow_missing_textures)


def _check_method(method: str) -> None:
    if method not in METHODS:
        raise SettingsError("--method", f"{method!r}; expected one of {', '.join(METHODS)}")


def _numbers(flag: str, text: str, *counts: int) -> list[float]:
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if not values or not all(map(math.isfinite, values)) or (counts and len(values) not in counts):
        wanted = " or ".join(map(str, counts)) or "one or more"
        raise SettingsError(flag, f"{text!r}; expected {wanted} finite numbers between commas")
    return values


def _viewpoint(
    azimuth: float | None, elevation: float | None, eye: str | None, target: str | None, fov: float | None
) -> Callable[[Fan | Model, float], Camera]:
    """What makes the camera that the flags ask for, from the object and the picture's aspect."""
    from runtime.pictures import eye_camera, orbit_camera

    if eye is None:
        for flag, value in (("--target", target), ("--fov", fov)):
            if value is not None:
                raise SettingsError(flag, f"{value} without --eye; expected both, or --azimuth and --elevation")
        around, above = azimuth or 0.0, 15.0 if elevation is None else elevation
        if not math.isfinite(around):
            raise SettingsError("--azimuth", f"{around:g} degrees; expected a finite number")
        if not abs(above) <= 90:
            raise SettingsError("--elevation", f"{above:g} degrees; expected -90 to 90")
        around, above = math.radians(around), math.radians(above)
        return lambda subject, aspect: orbit_camera(subject, around, above, aspect)
    for flag, value in (("--azimuth", azimuth), ("--elevation", elevation)):
        if value is not None:
            raise SettingsError(flag, f"{value:g} with --eye; expected one of the two")
    place, aim = _numbers("--eye", eye, 3), None if target is None else _numbers("--target", target, 3)
    return lambda subject, aspect: eye_camera(subject, place, aim, 40.0 if fov is None else fov, aspect)


def _light(text: str) -> DirectionalLight:
    from impostor.lighting import DirectionalLight

    azimuth, elevation, *color = _numbers("--light", text, 2, 5)
    if not abs(elevation) <= 90 or any(value < 0 for value in color):
        raise SettingsError(
            "--light", f"{text!r}; expected an elevation of -90 to 90 degrees and a colour of at least 0"
        )
    return DirectionalLight.from_angles(azimuth, elevation, color or (0.75, 0.75, 0.75))


def _gloss(text: str) -> Gloss:
    from impostor.lighting import Gloss

    strength, shininess = _numbers("--gloss", text, 2)
    if strength < 0 or shininess <= 0:
        raise SettingsError("--gloss", f"{text!r}; expected a strength of at least 0 and a shininess above 0")
    return Gloss(strength, shininess)


def _reflection(text: str, environment: Path | None) -> Reflection:
    from impostor.environment import Reflection

    if environment is None:
        raise SettingsError("--reflection", f"{text} without --environment; expected both")
    least, roughness, metal = _numbers("--reflection", text, 3)
    try:
        return Reflection(least=least, roughness=roughness, metal=metal)
    except SettingsError as error:
        raise SettingsError("--reflection", error.problem) from None


def _background(text: str) -> tuple[float, float, float, float]:
    if text == "transparent":
        return 0.0, 0.0, 0.0, 0.0
    red, green, blue = _numbers("--background", text, 3)
    if not 0 <= min(red, green, blue) <= max(red, green, blue) <= 1:
        raise SettingsError("--background", f"{text!r}; expected numbers of 0 to 1, or transparent")
    return red, green, blue, 1.0


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal() and 1 <= int(width) <= MAX_SIDE and 1 <= int(height) <= MAX_SIDE):
        raise SettingsError("--size", f"{text!r}; expected WIDTHxHEIGHT in pixels, such as 640x480, at most {MAX_SIDE}")
    return int(width), int(height)
