"""Renders the documentation's figures: `python -m docs.figures [NAME ...] [--out FOLDER]`.

Figures 3, 5a, 5b, 6b, 9 and 10 are counterparts of those in Dinh, Metoyer, Turk, "Real-Time Lighting Changes for
Image-Based Rendering"; those named `ptm_...` of figures in HPL-98-131 and HPL-2004-225, those
named `room_...` of GPU Gems, chapter 19; `hero` and `compare` are the
README's. All are made from sample_models by the project itself, but for those that end in
`photographs`: they need real captures and are not kept here, because the licence of those
wants a notice that is not at hand, or is not stated.
"""

from __future__ import annotations

import argparse
import io
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from docs.figure_layers import figure_3, figure_5a, figure_5b, figure_6b
from docs.figure_ptm import (
    ptm_direct,
    ptm_direct_photographs,
    ptm_dome,
    ptm_lights,
    ptm_lights_photographs,
    ptm_normals,
    ptm_photographs,
    ptm_quilt,
)
from docs.figure_rooms import room_day, room_localised, room_materials, room_shapes, room_sky, room_study
from docs.figure_scenes import compare, figure_9, figure_10, hero
from docs.studio import Studio
from impostor.files.output import atomic_output

FIGURES: dict[str, Callable[[Studio], Image.Image | None]] = {
    figure.__name__: figure
    for figure in (figure_3, figure_5a, figure_5b, figure_6b, figure_9, figure_10, hero, compare)
    + (ptm_dome, ptm_direct, ptm_lights, ptm_normals, ptm_quilt)
    + (ptm_photographs, ptm_direct_photographs, ptm_lights_photographs)
    + (room_study, room_localised, room_materials, room_shapes, room_day, room_sky)
}
FOLDER = Path(__file__).with_name("figures")
LARGEST = 700_000  # bytes


def png(picture: Image.Image) -> bytes:
    """A PNG of at most LARGEST bytes: neighbouring shades are merged as far as that takes."""
    encoded = b""
    for step in range(1, 9):
        # Each shade goes to the middle of its step, so that the picture does not darken.
        shades = np.minimum(np.arange(256) // step * step + step // 2, 255).astype(np.uint8)
        buffer = io.BytesIO()
        Image.fromarray(shades[np.asarray(picture)]).save(buffer, "PNG", optimize=True)
        encoded = buffer.getvalue()
        if len(encoded) <= LARGEST:
            break
    return encoded


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the figures named, or all."""
    parser = argparse.ArgumentParser(description="Render the documentation's figures.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(FIGURES)}; all if none is given")
    parser.add_argument("--out", type=Path, default=FOLDER, metavar="FOLDER")
    options = parser.parse_args(arguments)
    if unknown := set(options.names) - set(FIGURES):
        parser.error(f"{', '.join(sorted(unknown))}: no such figure; expected one of {', '.join(FIGURES)}")
    options.out.mkdir(parents=True, exist_ok=True)
    studio = Studio()
    for name in options.names or FIGURES:
        picture = FIGURES[name](studio)
        if picture is None:
            print(f"{name} left out: IMPOSTOR_DATA names no folder that holds its photographs", file=sys.stderr)
            continue
        encoded = png(picture)
        path = options.out / f"{name}.png"
        with atomic_output(path, force=True) as temporary:
            temporary.write_bytes(encoded)
        print(f"{path} ({len(encoded) / 1000:.0f} KB)", file=sys.stderr)


if __name__ == "__main__":
    main()
