"""`impostor ptm`: info, render, convert, relight-video, synthesise."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, cast

import typer

from impostor.commands import AsJson, Force, Quiet, as_flags, check_name, print_summary, progress_bar
from impostor.errors import SettingsError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from impostor.ptm import Polynomials, Ptm

OUTPUTS = ("lit", "normal", "albedo")
PATCH = 48  # texels


def _known_quality(quality: int | None) -> int | None:
    from impostor.files.ptm_file import check_quality

    if quality is not None:
        check_quality(quality, "--jpeg")
    return quality


PtmFile = Annotated[Path, typer.Argument(metavar="PTM", help="A .ptm file.")]
Jpeg = Annotated[
    int | None, typer.Option(metavar="QUALITY", help="Compress the planes; 1 to 100.", callback=_known_quality)
]
JpegPhotographs = Annotated[
    int | None,
    typer.Option("--jpeg", metavar="QUALITY", help="JPEG instead of PNG; 1 to 100.", callback=_known_quality),
]
NoPrediction = Annotated[
    bool, typer.Option("--no-prediction", help="No plane as a difference from another: for viewers that read none.")
]
Gain = Annotated[float, typer.Option(help="Diffuse gain: how much more strongly texels answer to the light.")]
Specular = Annotated[
    str | None, typer.Option(metavar="STRENGTH,EXPONENT", help="Add highlights on the PTM's own normals.")
]


def register(ptm: typer.Typer) -> None:
    """Add these commands to the `ptm` group."""
    for command in (info, render, convert, relight_video, synthesise):
        ptm.command(command.__name__.replace("_", "-"))(command)


def info(
    ptm: PtmFile,
    as_json: AsJson = False,
    coding: Annotated[
        bool, typer.Option("--coding", help="Also what the 1998 shift scheme and a codebook would lose.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Say what is in a PTM."""
    from impostor.summary import ptm_summary

    summary = ptm_summary(ptm)
    if coding:
        from impostor.files.ptm_file import read_ptm
        from impostor.ptm.coding import coding_losses

        with progress_bar(f"coding {ptm.name}", quiet) as progress:
            summary |= coding_losses(read_ptm(ptm).polynomials(), progress)
    print_summary(summary, as_json)


@as_flags("gain")
def render(
    ptm: PtmFile,
    output: Annotated[Path, typer.Option("-o", metavar="OUT.png")],
    light: Annotated[
        str | None, typer.Option(metavar="LU,LV", help="The light: to the right, and up; 0,0 is straight ahead.")
    ] = None,
    show: Annotated[str, typer.Option("--output", metavar="lit|normal|albedo")] = "lit",
    gain: Gain = 1.0,
    specular: Specular = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Draw a PTM under one light."""
    from impostor.files.pictures import save_png
    from impostor.files.ptm_file import read_ptm
    from impostor.ptm.normals import albedo, normals

    check_name(output, ".png", force)
    if show not in OUTPUTS:
        raise SettingsError("--output", f"{show!r}; expected one of {', '.join(OUTPUTS)}")
    if show != "lit":
        for flag, given in (
            ("--light", light is not None),
            ("--gain", gain != 1),
            ("--specular", specular is not None),
        ):
            if given:
                raise SettingsError(flag, f"given with --output {show}; expected it with a lit picture")
    toward = "0,0" if light is None else light
    at = numbers("--light", toward, 2)
    shine = _highlight(specular)
    polynomials = read_ptm(ptm).polynomials()
    if polynomials.parameters != "series":
        at = light_flag(toward)
    for flag, given in (("--output", show != "lit"), ("--gain", gain != 1), ("--specular", shine is not None)):
        if given:
            _check_lights(polynomials, ptm, flag)
    if show == "normal":
        picture = _bytes(normals(polynomials) / 2 + 0.5)
    elif show == "albedo":
        picture = _on_curve(polynomials, albedo(polynomials))
    else:
        picture = _Relit(polynomials, gain, shine).at(*at)
    save_png(output, picture, force=force)
    if not quiet:
        typer.echo(f"{ptm} -> {output} ({picture.shape[1]}x{picture.shape[0]})")


def convert(
    ptm: Annotated[Path, typer.Argument(metavar="IN", help="A .ptm file.")],
    output: Annotated[Path, typer.Argument(metavar="OUT", help="The new .ptm file.")],
    format: Annotated[str | None, typer.Option(metavar="rgb|lrgb|lum", help="Another kind of PTM.")] = None,
    jpeg: Jpeg = None,
    no_prediction: NoPrediction = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write a PTM as another kind, compressed or not."""
    from impostor.files.ptm_file import read_ptm
    from impostor.ptm import quantise
    from impostor.ptm.convert import FORMATS, converted

    check_name(output, ".ptm", force)
    kind = None if format is None else format.upper()
    if kind not in (None, *FORMATS):
        raise SettingsError("--format", f"{format!r}; expected rgb, lrgb or lum")
    read = read_ptm(ptm)
    before = ptm.stat().st_size  # now: the output may be the same file
    if kind not in (None, read.format):
        read = quantise(converted(read.polynomials(), cast(Literal["RGB", "LRGB", "LUM"], kind)))
    written = write_with_bar(read, output, jpeg, no_prediction, force, quiet)
    if not quiet:
        typer.echo(f"{ptm} ({before / 1e6:.2f} MB) -> {output} ({read.format}, {written / 1e6:.2f} MB)")


@as_flags("gain")
def relight_video(
    ptm: PtmFile,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT.mp4")],
    seconds: Annotated[float, typer.Option(help="Of the whole video.")] = 6.0,
    rate: Annotated[int, typer.Option(help="Pictures a second.")] = 25,
    elevation: Annotated[float, typer.Option(help="Of the light over the surface, degrees.")] = 40.0,
    gain: Gain = 1.0,
    specular: Specular = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Let the light go round a PTM once, from the top to the right."""
    import numpy as np

    from impostor.files.ptm_file import read_ptm
    from impostor.files.video import video_output

    check_name(output, ".mp4", force)
    if not 0 < seconds <= 3600:
        raise SettingsError("--seconds", f"{seconds:g}; expected more than 0, up to 3600")
    if not 1 <= rate <= 240:
        raise SettingsError("--rate", f"{rate}; expected 1 to 240")
    if not 0 <= elevation <= 90:
        raise SettingsError("--elevation", f"{elevation:g}; expected 0 to 90")
    shine, polynomials = _highlight(specular), read_ptm(ptm).polynomials()
    _check_lights(polynomials, ptm, "relight-video")
    relit, count = _Relit(polynomials, gain, shine), max(round(seconds * rate), 1)
    out = np.cos(np.radians(elevation))
    with (
        progress_bar(f"relighting {ptm.name}", quiet) as progress,
        video_output(output, polynomials.size, rate, force) as add,
    ):
        for index, angle in enumerate(2 * np.pi * np.arange(count) / count):
            add(relit.at(out * np.sin(angle), out * np.cos(angle)))
            progress(index + 1, count)
    if not quiet:
        typer.echo(f"{ptm} -> {output} ({count} pictures, {output.stat().st_size / 1e6:.1f} MB)")


def synthesise(
    ptm: PtmFile,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT.ptm")],
    size: Annotated[str, typer.Option(metavar="WxH", help="Texels of the result.")] = "512x512",
    patch: Annotated[
        int | None,
        typer.Option(
            help="Side of a patch: larger than what the surface is made of.",
            show_default=f"{PATCH}, or half of the PTM's shorter side",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="The same seed gives the same texture.")] = 0,
    jpeg: Jpeg = None,
    no_prediction: NoPrediction = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Quilt a PTM of any size that repeats without a seam."""
    from impostor.files.ptm_file import read_ptm
    from impostor.files.ptm_header import LARGEST_SIDE
    from impostor.ptm.synthesis import SMALLEST_PATCH
    from impostor.ptm.synthesis import synthesise as quilted

    check_name(output, ".ptm", force)
    try:
        width, height = (int(part) for part in size.lower().split("x"))
    except ValueError:
        raise SettingsError("--size", f"{size!r}; expected WIDTHxHEIGHT as 512x512") from None
    if max(width, height) > LARGEST_SIDE:
        raise SettingsError("--size", f"{size}; expected sides up to {LARGEST_SIDE}, as a .ptm can hold")
    read = read_ptm(ptm)
    if patch is None:
        patch = max(min(PATCH, min(read.size) // 2), SMALLEST_PATCH)
    with as_flags("size", "patch", "seed", PTM=str(ptm)), progress_bar(f"quilting {ptm.name}", quiet) as progress:
        made = quilted(read, (width, height), patch, seed, progress)
    written = write_with_bar(made, output, jpeg, no_prediction, force, quiet)
    if not quiet:
        typer.echo(f"{ptm} ({read.size[0]}x{read.size[1]}) -> {output} ({width}x{height}, {written / 1e6:.1f} MB)")


class _Relit:
    """A PTM as one light after the other shows it."""

    def __init__(self, polynomials: Polynomials, gain: float, shine: tuple[float, float] | None):
        from impostor.ptm.normals import diffuse_gain, normals

        self._polynomials = diffuse_gain(polynomials, gain) if gain != 1 else polynomials
        self._shine = shine
        self._normals = None if shine is None else normals(polynomials)

    def at(self, u: float, v: float) -> NDArray[np.uint8]:
        """The picture (H, W, 3), sRGB."""
        from impostor.ptm.normals import relight_specular
        from impostor.ptm.polynomials import evaluate, light_direction

        if self._shine is None or self._normals is None:
            return _on_curve(self._polynomials, evaluate(self._polynomials, u, v))
        toward = light_direction(u, v)
        strength, exponent = self._shine
        lit = relight_specular(self._polynomials, self._normals, toward, specular=strength, exponent=exponent)
        return _on_curve(self._polynomials, lit)


def _on_curve(polynomials: Polynomials, picture: NDArray[np.float32]) -> NDArray[np.uint8]:
    from impostor.srgb import srgb_from_linear

    return _bytes(srgb_from_linear(picture) if polynomials.curve == "linear" else picture)


def _bytes(picture: NDArray[np.floating]) -> NDArray[np.uint8]:
    import numpy as np

    return np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8)


def write_with_bar(ptm: Ptm, output: Path, jpeg: int | None, no_prediction: bool, force: bool, quiet: bool) -> int:
    """Write a PTM as flags ask for it: the file's size in bytes."""
    from impostor.files.ptm_file import write_ptm

    if jpeg is None:
        if no_prediction:
            raise SettingsError("--no-prediction", "given without --jpeg; expected both, raw files predict nothing")
        return write_ptm(ptm, output, force=force)
    if ptm.format == "LUM":
        raise SettingsError("--jpeg", "the PTM is LUM; expected LRGB or RGB, which have a compressed kind")
    predict = not no_prediction
    with progress_bar(f"compressing {output.name}", quiet) as progress:
        return write_ptm(ptm, output, compression="jpeg", quality=jpeg, predict=predict, force=force, progress=progress)


def _check_lights(polynomials: Polynomials, ptm: Path, wanted: str) -> None:
    """Refuse a PTM whose parameters are no light's, where what is wanted needs that."""
    if polynomials.parameters != "light":
        whose = "the viewer's direction" if polynomials.parameters == "view" else "those of an image series"
        raise SettingsError(ptm, f"its parameters are {whose}; expected light directions, for {wanted}")


def _highlight(specular: str | None) -> tuple[float, float] | None:
    if specular is None:
        return None
    strength, exponent = numbers("--specular", specular, 2)
    if strength < 0 or exponent < 0:
        raise SettingsError("--specular", f"{specular}; expected a strength and an exponent of 0 or more")
    return strength, exponent


def light_flag(text: str) -> tuple[float, ...]:
    """(lu, lv) of `--light`: two components of a unit vector."""
    at = numbers("--light", text, 2)
    if at[0] ** 2 + at[1] ** 2 > 1:
        raise SettingsError("--light", f"{text}; expected LU and LV of a unit vector, lu² + lv² at most 1")
    return at


def numbers(flag: str, text: str, count: int) -> tuple[float, ...]:
    """So many finite numbers with commas between them, as a flag gives them."""
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count or not all(abs(value) < float("inf") for value in values):
        raise SettingsError(flag, f"{text!r}; expected {count} numbers with a comma between them, as 0.3,-0.5")
    return values
