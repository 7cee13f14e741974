"""`impostor environment`: info, convert."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from impostor.commands import AsJson, Force, Quiet, as_flags, check_name, print_summary
from impostor.errors import SettingsError

if TYPE_CHECKING:
    from impostor.environment import Environment

MOST_LIGHTS = 16

MapFile = Annotated[
    Path, typer.Argument(metavar="MAP", help="A panorama, a cross, a folder of six faces, or 'name_*.jpg' for them.")
]
Exposure = Annotated[float, typer.Option(help="Multiplies the light.")]
Mirrored = Annotated[bool, typer.Option("--mirrored", help="The map is drawn for the other handedness: writing is.")]
FlipY = Annotated[bool, typer.Option("--flip-y", help="The map is upside down.")]


def register(environment: typer.Typer) -> None:
    """Add these commands to the `environment` group."""
    for command in (info, convert):
        environment.command(command.__name__)(command)


def info(
    file: MapFile,
    as_json: AsJson = False,
    picture: Annotated[
        Path | None,
        typer.Option("--picture", "-o", metavar="OUT.png", help="Show it, its lights, and three balls in it."),
    ] = None,
    lights: Annotated[int, typer.Option(metavar="N", help="How many of the brightest lights; up to 16.")] = 3,
    exposure: Exposure = 1.0,
    mirrored: Mirrored = False,
    flip_y: FlipY = False,
    force: Force = False,
) -> None:
    """Say how bright an environment map is, and where its light comes from."""
    from impostor.environment.summary import environment_sheet, environment_summary, lights_of
    from impostor.files.environment_file import describe_map
    from impostor.files.pictures import save_png

    if picture is not None:
        check_name(picture, ".png", force)
    if not 1 <= lights <= MOST_LIGHTS:
        raise SettingsError("--lights", f"{lights}; expected 1 to {MOST_LIGHTS}")
    environment = _read(file, None, exposure, mirrored, flip_y)
    brightest = lights_of(environment, lights)
    summary = {"file": str(file), "kind": describe_map(file)} | environment_summary(environment, brightest)
    del summary["name"]
    if picture is not None:
        save_png(picture, environment_sheet(environment, brightest), force=force)
    print_summary(summary if as_json else _with_lines_of_lights(summary), as_json)


def convert(
    source: Annotated[Path, typer.Argument(metavar="IN", help="As for `info`.")],
    output: Annotated[
        Path,
        typer.Argument(metavar="OUT", help="A panorama .hdr, .exr or .png; a folder, or 'name_*.png', for six faces."),
    ],
    size: Annotated[int | None, typer.Option(metavar="N", help="Side of a face; a panorama is 4 N x 2 N.")] = None,
    exposure: Exposure = 1.0,
    mirrored: Mirrored = False,
    flip_y: FlipY = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write an environment map as a panorama or as six faces."""
    from impostor.files.environment_file import describe_map, output_files, write_environment

    output_files(output, force)
    environment = _read(source, size, exposure, mirrored, flip_y)
    before = describe_map(source)  # now: the output may be the same file
    written = write_environment(output, environment, force=force)
    if not quiet:
        side = environment.size
        after = f"panorama, {4 * side}x{2 * side}" if len(written) == 1 else f"six faces, {side}x{side}"
        total = sum(file.stat().st_size for file in written)
        typer.echo(f"{source} ({before}) -> {output} ({after}, {total / 1e6:.2f} MB)")


def _read(path: Path, size: int | None, exposure: float, mirrored: bool, flip_y: bool) -> Environment:
    from impostor.files.environment_file import read_environment

    with as_flags("size", "exposure"):
        return read_environment(path, size, exposure=exposure, mirrored=mirrored, flip_y=flip_y)


def _with_lines_of_lights(summary: dict[str, Any]) -> dict[str, Any]:
    """For people: each light has its own line."""
    lights = summary.pop("lights")
    return summary | {f"light_{number}": light for number, light in enumerate(lights, 1)}
