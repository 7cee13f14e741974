"""`impostor ptm`: from photographs to a PTM, and to its measure."""

from __future__ import annotations

import json
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from impostor.commands import AsJson, Force, Quiet, UpAxis, as_flags, check_name, progress_bar
from impostor.errors import OutputError, PhotographError, SettingsError
from impostor.ptm_cli import Jpeg, JpegPhotographs, light_flag, numbers, write_with_bar

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from bake.photographs import Photographs

SIZE, DEPTH = 256, 32.0  # texels, of what `capture` photographs
PICTURES = {".png", ".tif", ".tiff", ".jpg", ".jpeg", ".tga", ".bmp"}

Workers = Annotated[int | None, typer.Option(metavar="N", help="Threads; as many as processors if left out.")]
CaptureFile = Annotated[Path, typer.Argument(metavar="IMAGES.lp", help="Photographs and their lights.")]


def register(ptm: typer.Typer) -> None:
    """Add this stage's commands to the `ptm` group."""
    for command in (fit, compare, direct, capture, lights):
        ptm.command(command.__name__)(command)


@as_flags("format", "space", "workers")
def fit(
    images: CaptureFile,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT.ptm")],
    format: Annotated[str, typer.Option(metavar="lrgb|rgb|lum")] = "lrgb",
    robust: Annotated[bool, typer.Option("--robust", help="Trust shadows and highlights less.")] = False,
    linear: Annotated[bool, typer.Option("--linear", help="Fit light, not the stored sRGB values.")] = False,
    jpeg: Jpeg = None,
    space: Annotated[
        str | None, typer.Option(metavar="ycbcr|principal", help="Colour space of --format lum; ycbcr.")
    ] = None,
    series: Annotated[
        int | None, typer.Option(metavar="1|2", help="Lines hold one or two parameters instead of a light.")
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Directions are the viewer's; the light stood still.")] = False,
    workers: Workers = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Fit a polynomial texture map to photographs of one object under many lights."""
    from bake.design import ALL_TERMS, ONE_PARAMETER, make_design
    from bake.photographs import open_photographs
    from bake.ptm import check_choices, fit_ptm, worker_count
    from impostor.ptm import quantise

    started = time.monotonic()
    check_name(output, ".ptm", force)
    curve, format = "linear" if linear else "srgb", format.lower()
    check_choices(format, curve, space or "ycbcr")
    if space is not None and format != "lum":
        raise SettingsError("--space", f"given with --format {format}; expected --format lum")
    worker_count(workers)
    if series not in (None, 1, 2):
        raise SettingsError("--series", f"{series}; expected 1 or 2")
    if series is not None and view:
        raise SettingsError("--view", "given with --series; expected one of them")
    if jpeg is not None and format == "lum":
        raise SettingsError("--jpeg", "given with --format lum; expected lrgb or rgb, which have a compressed kind")

    files, parameters, notes = _series(images, series) if series else (*_lights(images), "")
    terms = ONE_PARAMETER if series == 1 else ALL_TERMS
    design = make_design(parameters, terms, images)
    photographs = open_photographs(files)
    with progress_bar(f"fitting {images.name}", quiet) as progress:
        polynomials = fit_ptm(
            photographs,
            parameters,
            format=format,
            curve=curve,
            meaning="series" if series else "view" if view else "light",
            terms=terms,
            space=space or "ycbcr",
            robust=robust,
            workers=workers,
            progress=progress,
        )
    coefficients = quantise(polynomials)
    del polynomials
    written = write_with_bar(coefficients, output, jpeg, False, force, quiet)
    if not quiet:
        width, height = photographs.size
        typer.echo(
            f"{images} ({len(photographs)} photographs, condition number {design.condition:.1f}{notes}) -> {output} "
            f"({width}x{height} {format.upper()}, {written / 1e6:.1f} MB) in {time.monotonic() - started:.1f} s"
        )


@as_flags("workers")
def compare(
    ptm: Annotated[Path, typer.Argument(metavar="PTM")],
    test: Annotated[Path, typer.Argument(metavar="TEST.lp", help="Photographs that were not fitted.")],
    as_json: AsJson = False,
    workers: Workers = None,
    quiet: Quiet = False,
) -> None:
    """Measure a PTM against photographs under other lights: PSNR of the stored values."""
    from bake.held_out import score
    from bake.ptm import worker_count
    from impostor.files.ptm_file import read_ptm
    from impostor.ptm.polynomials import evaluate
    from impostor.srgb import srgb_from_linear

    polynomials = read_ptm(ptm).polynomials()
    if polynomials.parameters == "series":
        raise SettingsError(ptm, "its parameters are those of an image series; expected a direction's, as the .lp has")
    photographs, parameters = _capture(test)

    def draw(lu: float, lv: float) -> NDArray[np.floating]:
        picture = evaluate(polynomials, lu, lv)
        return srgb_from_linear(picture) if polynomials.curve == "linear" else picture

    with progress_bar(f"comparing {ptm.name}", quiet) as progress:
        found = score(draw, polynomials.size, photographs, parameters, worker_count(workers), progress)
    if as_json:
        print(json.dumps(asdict(found), indent=2))
        return
    width = max(len(row.photograph) for row in found.per_light)
    print(f"{'photograph':{width}}      lu      lv  PSNR dB")
    for row in found.per_light:
        print(f"{row.photograph:{width}}  {row.lu:6.3f}  {row.lv:6.3f}  {row.psnr_db:7.2f}")
    print(f"{'all':{width}}                  {found.psnr_db:7.2f}")


def direct(
    images: CaptureFile,
    light: Annotated[str, typer.Option(metavar="LU,LV", help="The light: to the right, and up.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT.png")],
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Blend the photographs whose lights stand around a light: no fit, the most that a fit can hope for."""
    import numpy as np

    from bake.direct import LightTriangulation, render_direct
    from impostor.files.pictures import save_png

    check_name(output, ".png", force)
    lu, lv = light_flag(light)
    photographs, parameters = _capture(images)
    triangulation = LightTriangulation(parameters)
    picture = render_direct(photographs, triangulation, lu, lv)
    save_png(output, np.rint(picture * 255).clip(0, 255).astype(np.uint8), force=force)
    if not quiet:
        indices, weights = triangulation.weights(lu, lv)
        parts = [f"{photographs.paths[i].name} {w:.0%}" for i, w in zip(indices, weights, strict=True)]
        typer.echo(f"{images} -> {output} ({', '.join(parts)})")


@as_flags("dome", "depth", "size", side="--from", lights="--dome")
def capture(
    subject: Annotated[Path, typer.Argument(metavar="MODEL|HEIGHTS.png", help="A mesh, or heights as a gray picture.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT.lp", help="Photographs go beside it.")],
    dome: Annotated[
        str, typer.Option(metavar="geodesic|fibonacci:N[:DEG]|rings:DEGxN,...", help="Where the lights stand.")
    ] = "geodesic",
    size: Annotated[int | None, typer.Option(metavar="TEXELS", help=f"Side of a mesh's photographs; {SIZE}.")] = None,
    side: Annotated[
        str | None, typer.Option("--from", metavar="front|top", help="Where a mesh is seen from; front.")
    ] = None,
    depth: Annotated[
        float | None, typer.Option(metavar="TEXELS", help=f"Height of white in a picture of heights; {DEPTH:g}.")
    ] = None,
    albedo: Annotated[Path | None, typer.Option(metavar="PNG", help="Colour of a picture of heights.")] = None,
    gloss: Annotated[str | None, typer.Option(metavar="STRENGTH,SHININESS", help="A highlight.")] = None,
    no_bounce: Annotated[bool, typer.Option("--no-bounce", help="Direct light only.")] = False,
    jpeg: JpegPhotographs = None,
    up: UpAxis = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Photograph a mesh or a height picture under a dome, with its own shadows and one bounce of light."""
    from bake.dome import parse_dome
    from bake.reliefs import photograph_paths, relief_of_model, relief_of_picture, write_capture
    from bake.synthetic_capture import photograph

    check_name(output, ".lp", force)
    directions = parse_dome(dome)
    for given in filter(None, (subject, albedo)):
        if given.resolve() in {path.resolve() for path in photograph_paths(output, len(directions), jpeg)}:
            raise OutputError(given, "would be replaced by a photograph; expected another name for the set")
    strength, shininess = (0.0, 60.0) if gloss is None else numbers("--gloss", gloss, 2)
    if strength < 0 or shininess <= 0:
        raise SettingsError("--gloss", f"{gloss}; expected a strength of 0 or more, a shininess above 0")
    highlight = strength, shininess
    if subject.suffix.lower() in PICTURES:
        _refuse(subject, "a model", size=size, **{"from": side}, up=up)
        with as_flags(relief=str(subject)):
            relief = relief_of_picture(subject, DEPTH if depth is None else depth, albedo, highlight)
    else:
        from impostor.model import load_model

        _refuse(subject, "a picture of heights", depth=depth, albedo=albedo)
        size, side = SIZE if size is None else size, "front" if side is None else side
        relief = relief_of_model(load_model(subject, up=up or "y"), size, side, highlight)
    with progress_bar(f"photographing {subject.name}", quiet) as progress:
        pictures = photograph(relief, directions, bounce=not no_bounce, progress=progress)
    write_capture(list(pictures), directions, output, quality=jpeg, force=force)
    if not quiet:
        height, width = relief.heights.shape
        typer.echo(f"{subject} -> {output} ({len(pictures)} photographs of {width}x{height})")


@as_flags("circle")
def lights(
    photographs: Annotated[list[Path], typer.Argument(metavar="BALL...", help="Photographs of a mirror ball.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT.lp")],
    mask: Annotated[Path | None, typer.Option(metavar="PICTURE", help="White where the ball is.")] = None,
    circle: Annotated[
        str | None, typer.Option(metavar="X,Y,RADIUS", help="The ball, in pixels from the top left.")
    ] = None,
    of: Annotated[
        list[Path] | None,
        typer.Option(
            "--of", metavar="PHOTOGRAPH", help="What the file is to name instead, in the same order; repeatable."
        ),
    ] = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Find the lights of a capture set from their highlights on a mirror ball."""
    from bake.chrome_ball import Circle, circle_of_mask, lights_of_ball, read_mask
    from bake.ptm import light_parameters
    from impostor.files.lp_file import CaptureSet, write_lp

    check_name(output, ".lp", force)
    if (mask is None) == (circle is None):
        raise SettingsError("--mask", "expected either --mask or --circle, to know where the ball is")
    named = of or photographs
    if len(named) != len(photographs):
        raise SettingsError("--of", f"{len(named)} photographs; expected {len(photographs)}, one for each of the ball")
    for path in named:
        if not path.is_file():
            raise PhotographError(path, "does not exist; expected a photograph for the .lp to name")
    ball = circle_of_mask(read_mask(mask), mask) if mask else Circle(*numbers("--circle", circle or "", 3))
    found = CaptureSet(tuple(named), lights_of_ball(photographs, ball))
    light_parameters(found)  # what `fit` would refuse is not written
    write_lp(found, output, force)
    if not quiet:
        place = f"ball at {ball.x:.1f}, {ball.y:.1f}, radius {ball.radius:.1f}"
        typer.echo(f"{len(named)} lights -> {output} ({place})")


def _refuse(subject: Path, wanted: str, **flags: object) -> None:
    """Refuse flags that say nothing about what is to be photographed."""
    for name, value in flags.items():
        if value is not None:
            raise SettingsError(f"--{name}", f"given with {subject}; expected it with {wanted}")


def _capture(lp: Path) -> tuple[Photographs, NDArray[np.float64]]:
    from bake.photographs import open_photographs

    files, parameters = _lights(lp)
    return open_photographs(files), parameters


def _lights(lp: Path) -> tuple[tuple[Path, ...], NDArray[np.float64]]:
    from bake.ptm import light_parameters
    from impostor.files.lp_file import read_lp

    capture = read_lp(lp)
    return capture.photographs, light_parameters(capture)


def _series(path: Path, count: int) -> tuple[tuple[Path, ...], NDArray[np.float64], str]:
    from bake.series import read_series

    series = read_series(path, count)
    ranges = "".join(
        f", {name} -1..1 is {low:g}..{high:g}" for name, (low, high) in zip("uv", series.ranges(), strict=False)
    )
    return series.photographs, series.parameters, ranges
