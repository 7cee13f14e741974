"""`impostor bake`."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Annotated

import typer

from impostor.commands import AllowMissing, Force, Quiet, UpAxis, as_flags, check_name, progress_bar


def register(app: typer.Typer) -> None:
    """Add this stage's commands."""
    app.command("bake")(bake)


@as_flags("views", "elevation", "layout", "size", "samples", distance="--perspective")
def bake(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="GLB, glTF, OBJ, PLY, STL, OFF, 3MF or COLLADA.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT.fan")],
    views: Annotated[int, typer.Option(help="Number of cameras.")] = 96,
    elevation: Annotated[float | None, typer.Option(metavar="DEG", help="Of a ring of cameras; 15.")] = None,
    layout: Annotated[str, typer.Option(metavar="ring|hemisphere|sphere")] = "ring",
    size: Annotated[int, typer.Option(metavar="TEXELS", help="Side of a tile.")] = 256,
    perspective: Annotated[
        float | None, typer.Option(metavar="DIST", help="Metres to a perspective camera; orthographic if left out.")
    ] = None,
    samples: Annotated[
        int | None, typer.Option(metavar="1|2|4", help="Samples along a texel's side; 4 for textures, else 2.")
    ] = None,
    up: UpAxis = None,
    allow_missing_textures: AllowMissing = False,
    picture: Annotated[
        Path | None, typer.Option(metavar="PNG", help="Also write the layers of eight views as a picture.")
    ] = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Bake a model into a fan: colour, depth, normal codes and silhouette from a circle of cameras."""
    from bake.settings import camera_bases
    from impostor.errors import SettingsError

    started = time.monotonic()
    # All that can be refused without the model is refused before it is loaded.
    check_name(output, ".fan", force)
    if picture is not None:
        check_name(picture, ".png", force)
    if perspective == math.inf:
        raise SettingsError("--perspective", "inf m; expected a distance, or none for an orthographic camera")
    distance = math.inf if perspective is None else perspective
    camera_bases(views, elevation, layout, size, distance, samples)

    from impostor.files.fan_file import write_fan
    from impostor.model import load_model

    mesh = load_model(model, up=up or "y", allow_missing_textures=allow_missing_textures)
    from bake.fan import bake_fan

    with progress_bar(f"baking {model.name}", quiet) as progress:
        fan = bake_fan(
            mesh,
            views=views,
            elevation_deg=elevation,
            layout=layout,
            size=size,
            distance=distance,
            samples=samples,
            up=up or "y",
            progress=progress,
        )
    written = write_fan(output, fan, force)
    if picture is not None:
        from impostor.summary import write_contact_sheet

        write_contact_sheet(fan, picture, force)
    if not quiet:
        per_texel = written / max(fan.covered_texels, 1)
        typer.echo(
            f"{model} ({mesh.triangle_count:,} triangles) -> {output} ({views} views of {size}x{size}, "
            f"{written / 1e6:.1f} MB, {per_texel:.2f} bytes a covered texel) in {time.monotonic() - started:.1f} s"
        )
