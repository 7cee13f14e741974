"""From a mesh to a relit impostor, with pictures of every step: `make demo`.

    python examples/demo.py [MODEL] [--views 96] [--size 384] [--out demo_output]

Bakes a model into a fan with the functions that the command line calls, then writes into the folder

    NAME.fan          the fan
    NAME_layers.png   colour, normals, depth and silhouette of eight views
    NAME_relit.png    the impostor under four suns, with its shadow
    NAME_compare.png  mesh, impostor and their difference, from a camera between the baked views
    index.html        all of it on one page

and prints where they are and how close the impostor is to the mesh. Running it again replaces its own outputs.
"""

from __future__ import annotations

import argparse
import html
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bake.fan import bake_fan
from impostor import DirectionalLight, Fan, Gloss, ImpostorError, Model, load, load_model, save
from impostor.commands import progress_bar
from impostor.files.output import atomic_output
from impostor.files.pictures import save_png
from impostor.summary import write_contact_sheet
from runtime.compare import Comparison, between_cameras, errors, side_by_side
from runtime.gl.context import make_context
from runtime.pictures import PictureSettings, draw_picture, orbit_camera

ROOT = Path(__file__).resolve().parents[1]
SUNS = (  # azimuth and elevation in degrees, linear colour
    (-60, 18, (2.1, 1.30, 0.70)),
    (-38, 34, (1.3, 1.22, 1.10)),
    (75, 36, (1.2, 1.20, 1.20)),
    (118, 20, (1.9, 1.10, 0.75)),
)
AMBIENT = (0.16, 0.19, 0.25)


def relit(ctx, fan: Fan, side: int) -> NDArray[np.uint8]:
    """One view of the impostor under every sun: (side, side x suns, 4) uint8."""
    camera = orbit_camera(fan, np.radians(31.9), np.radians(15), aspect=1.0)
    strip = []
    for azimuth, elevation, color in SUNS:
        sun = DirectionalLight.from_angles(azimuth, elevation, color)
        settings = PictureSettings(side, side, (sun,), AMBIENT, Gloss(0.08, 40))
        strip.append(draw_picture(ctx, fan, camera, settings))
    return np.hstack(strip)


def compared(ctx, fan: Fan, model: Model) -> tuple[NDArray[np.uint8], float]:
    """Mesh, impostor and difference side by side, and the PSNR in dB over the object's pixels."""
    comparison = Comparison(ctx, fan, model)
    try:
        azimuth = between_cameras(fan, 8)[1]
        pair = comparison.pair(azimuth, np.radians(fan.settings["elevation"]))
    finally:
        comparison.release()
    return side_by_side([pair]), errors(pair)[0]


def write_index(path: Path, name: str, files: dict[str, Path]) -> None:
    """A page that shows every picture."""
    parts = [f"<!doctype html><meta charset=utf-8><title>{html.escape(name)}</title>"]
    parts.append("<style>body{font:16px sans-serif;margin:2em;background:#f7f6f2}img{max-width:100%}</style>")
    for text, file in files.items():
        link = html.escape(file.name)
        shown = f"<img src='{link}' alt=''>" if file.suffix == ".png" else ""
        parts.append(f"<p><a href='{link}'>{link}</a>: {html.escape(text)}</p>{shown}")
    with atomic_output(path, force=True) as temporary:
        temporary.write_text("\n".join(parts) + "\n", encoding="utf-8")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the demo."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("model", type=Path, nargs="?", default=ROOT / "sample_models" / "statue.glb", metavar="MODEL")
    parser.add_argument("--views", type=int, default=96)
    parser.add_argument("--size", type=int, default=384, metavar="TEXELS")
    parser.add_argument("--out", type=Path, default=ROOT / "demo_output", metavar="FOLDER")
    options = parser.parse_args(arguments)
    started = time.monotonic()
    options.out.mkdir(parents=True, exist_ok=True)
    name = options.model.stem

    model = load_model(options.model)
    with progress_bar(f"baking {options.model.name}") as progress:
        fan = bake_fan(model, views=options.views, size=options.size, progress=progress)
    baked = time.monotonic() - started

    files = {"the fan": options.out / f"{name}.fan"}
    written = save(files["the fan"], fan, force=True)
    fan = load(files["the fan"])
    pictures = {
        "colour, normals, depth and silhouette of eight views": options.out / f"{name}_layers.png",
        "the impostor under four suns": options.out / f"{name}_relit.png",
        "mesh, impostor, and 4 x their difference": options.out / f"{name}_compare.png",
    }
    sheet, suns, comparison = pictures.values()
    ctx = make_context()
    write_contact_sheet(fan, sheet, force=True)
    save_png(suns, relit(ctx, fan, side=fan.size), force=True)
    picture, psnr = compared(ctx, fan, model)
    save_png(comparison, picture, force=True)
    index = options.out / "index.html"
    write_index(index, name, files | pictures)

    print(f"{options.model.name}: {model.triangle_count:,} triangles")
    print(f"baked {options.views} views of {options.size}x{options.size} in {baked:.1f} s, {written / 1e6:.1f} MB")
    print(f"impostor against mesh, between two baked views: {psnr:.1f} dB")
    for text, file in {**files, **pictures, "all of it on one page": index}.items():
        print(f"{file}  {text}")
    print(f"{time.monotonic() - started:.1f} s in all")


if __name__ == "__main__":
    try:
        main()
    except ImpostorError as problem:
        sys.exit(f"demo: {problem}")
