"""`impostor ptm`: fit, compare, direct."""

from __future__ import annotations

import json
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from impostor.cli import AsJson, Force, Quiet, check_name, progress_bar
from impostor.errors import SettingsError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from bake.photographs import Photographs

Workers = Annotated[int | None, typer.Option(metavar="N", help="Threads; as many as processors if left out.")]
CaptureFile = Annotated[Path, typer.Argument(metavar="IMAGES.lp", help="Photographs and their lights.")]


def register(ptm: typer.Typer) -> None:
    """Add this stage's commands to the `ptm` group."""
    for command in (fit, compare, direct):
        ptm.command(command.__name__)(command)


def fit(
    images: CaptureFile,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT.ptm")],
    format: Annotated[str, typer.Option(metavar="lrgb|rgb|lum")] = "lrgb",
    robust: Annotated[bool, typer.Option("--robust", help="Trust shadows and highlights less.")] = False,
    linear: Annotated[bool, typer.Option("--linear", help="Fit light, not the stored sRGB values.")] = False,
    jpeg: Annotated[int | None, typer.Option(metavar="QUALITY", help="Compress the planes; 1 to 100.")] = None,
    space: Annotated[str, typer.Option(metavar="ycbcr|principal", help="Colour space of --format lum.")] = "ycbcr",
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
    from impostor.files.ptm_file import write_ptm
    from impostor.ptm import quantise

    started = time.monotonic()
    check_name(output, ".ptm", force)
    curve = "linear" if linear else "srgb"
    check_choices(format, curve, space)
    worker_count(workers)
    if series not in (None, 1, 2):
        raise SettingsError("--series", f"{series}; expected 1 or 2")
    if series is not None and view:
        raise SettingsError("--view", "given with --series; expected one of them")
    if jpeg is not None and not 1 <= jpeg <= 100:
        raise SettingsError("--jpeg", f"{jpeg}; expected 1 to 100")
    if jpeg is not None and format == "lum":
        raise SettingsError("--jpeg", "given with --format lum; expected lrgb or rgb, which have a compressed kind")

    files, parameters, notes = _series(images, series) if series else _lights(images)
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
            space=space,
            robust=robust,
            workers=workers,
            progress=progress,
        )
    coefficients = quantise(polynomials)
    del polynomials
    if jpeg is None:
        written = write_ptm(coefficients, output, force=force)
    else:
        written = write_ptm(coefficients, output, compression="jpeg", quality=jpeg, force=force)
    if not quiet:
        width, height = photographs.size
        typer.echo(
            f"{images} ({len(photographs)} photographs, condition number {design.condition:.1f}{notes}) -> {output} "
            f"({width}x{height} {format.upper()}, {written / 1e6:.1f} MB) in {time.monotonic() - started:.1f} s"
        )


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
    from PIL import Image

    from bake.direct import LightTriangulation, render_direct
    from impostor.files.output import atomic_output

    check_name(output, ".png", force)
    lu, lv = _two_numbers("--light", light)
    photographs, parameters = _capture(images)
    triangulation = LightTriangulation(parameters)
    picture = render_direct(photographs, triangulation, lu, lv)
    with atomic_output(output, force) as temporary:
        Image.fromarray(np.rint(picture * 255).clip(0, 255).astype(np.uint8)).save(temporary, "PNG")
    if not quiet:
        indices, weights = triangulation.weights(lu, lv)
        parts = [f"{photographs.paths[i].name} {w:.0%}" for i, w in zip(indices, weights, strict=True)]
        typer.echo(f"{images} -> {output} ({', '.join(parts)})")


def _capture(lp: Path) -> tuple[Photographs, NDArray[np.float64]]:
    from bake.photographs import open_photographs

    files, parameters, _ = _lights(lp)
    return open_photographs(files), parameters


def _lights(lp: Path) -> tuple[tuple[Path, ...], NDArray[np.float64], str]:
    from bake.ptm import light_parameters
    from impostor.files.lp_file import read_lp

    capture = read_lp(lp)
    return capture.photographs, light_parameters(capture), ""


def _series(path: Path, count: int) -> tuple[tuple[Path, ...], NDArray[np.float64], str]:
    from bake.series import read_series

    series = read_series(path, count)
    ranges = "".join(
        f", {name} -1..1 is {low:g}..{high:g}" for name, (low, high) in zip("uv", series.ranges(), strict=False)
    )
    return series.photographs, series.parameters, ranges


def _two_numbers(flag: str, text: str) -> tuple[float, float]:
    try:
        first, second = (float(part) for part in text.split(","))
    except ValueError:
        raise SettingsError(flag, f"{text!r}; expected two numbers as 0.3,-0.5") from None
    return first, second
