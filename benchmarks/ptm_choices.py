"""Tables "ptm_formats" and "ptm_lights": what the format of a PTM and the number of its lights cost and keep."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake.photographs import Photographs, open_photographs
from bake.ptm import fit_ptm
from benchmarks.ptm import Lit, capture, direct_psnr, psnr
from benchmarks.tables import Row, Table
from benchmarks.workbench import DATA, SAMPLES, Workbench, say
from impostor.files.ptm_file import read_ptm, write_ptm
from impostor.ptm import quantise

HELD_OUT = 5  # every fifth photograph measures what the others say
NOTES = {
    1: "the sample capture, every fifth photograph held out, in place of the real ones.",
    2: "the lion's head is 240 real photographs, every fifth held out; the frieze a glossy synthetic relief with deep "
    "shadows, 49 lights, 20 others held out.",
}  # by the number of sets
COUNTS = (8, 12, 24, 48, 96, 192)
FORMATS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "RGB": ({"format": "rgb"}, {}),
    "LRGB": ({"format": "lrgb"}, {}),
    "LUM": ({"format": "lum"}, {}),
    "RGB, `--jpeg 95`": ({"format": "rgb"}, {"compression": "jpeg", "quality": 95}),
    "LRGB, `--jpeg 95`": ({"format": "lrgb"}, {"compression": "jpeg", "quality": 95}),
    "LRGB, `--robust`": ({"format": "lrgb", "robust": True}, {}),
}


def run_formats(bench: Workbench) -> Table:
    """PSNR under lights that were not fitted, and size, of files of every format."""
    sets = _sets()
    columns = {f"{key}_db": f"{label}, dB" for key, (label, *_) in sets.items()}
    columns["bytes"] = f"bytes a texel, {list(sets.values())[-1][0]}"
    table = Table("ptm_formats", "Formats of a PTM, under lights that were not fitted", columns)
    path = bench.folder / "format.ptm"
    for label, (fit, write) in FORMATS.items():
        say(f"ptm_formats: {label}")
        values = {}
        for key, (_, fitted, test) in sets.items():
            size = write_ptm(quantise(fit_ptm(*fitted, **fit)), path, force=True, **write)
            values[f"{key}_db"] = psnr(read_ptm(path).polynomials(), test)
            values["bytes"] = size / (fitted[0].size[0] * fitted[0].size[1])
        table.rows.append(Row(label, label, values))
    values = {f"{key}_db": direct_psnr(fitted, test) for key, (_, fitted, test) in sets.items()}
    table.rows.append(Row("direct", "the photographs, blended", values))
    table.notes.append("PSNR of stored (sRGB) values, from the file as it was written; " + NOTES[len(sets)])
    return table


def run_lights(bench: Workbench) -> Table:
    """PSNR under lights that were not fitted, by the number of lights that were."""
    label, (photographs, parameters), test = next(iter(_sets().values()))
    table = Table("ptm_lights", f"Lights of a capture: {label}", {"lrgb_db": "LRGB, dB", "direct_db": "blended, dB"})
    order = _spread(parameters)
    for count in (*(count for count in COUNTS if count < len(order)), len(order)):
        say(f"ptm_lights: {count}")
        fitted = _chosen(photographs, parameters, np.sort(order[:count]))
        path = bench.folder / "lights.ptm"
        write_ptm(quantise(fit_ptm(*fitted)), path, force=True)
        values = {"lrgb_db": psnr(read_ptm(path).polynomials(), test), "direct_db": direct_psnr(fitted, test)}
        table.rows.append(Row(str(count), str(count), values))
    table.notes.append("Spread evenly: each light is the one farthest from those before it. Every fifth is held out.")
    return table


def _sets() -> dict[str, tuple[str, Lit, Lit]]:
    """Name, what is fitted and what is held out of each set at hand."""
    lion, frieze = DATA / "rti" / "loewenkopf" / "dirs.lp", DATA / "rti" / "synthrti" / "Object2" / "material2"
    if not (lion.is_file() and frieze.is_dir()):
        return {"rosette": ("rosette", *_halved(SAMPLES / "relief" / "rosette.lp"))}
    parts = [capture(frieze / part / "dirs.lp") for part in ("Dome", "Test")]
    return {"lion": ("lion's head", *_halved(lion)), "frieze": ("frieze", parts[0], parts[1])}


def _halved(lp: Path) -> tuple[Lit, Lit]:
    photographs, parameters = capture(lp)
    held = np.arange(len(photographs)) % HELD_OUT == 0
    fitted, test = (_chosen(photographs, parameters, np.flatnonzero(chosen)) for chosen in (~held, held))
    return fitted, test


def _chosen(photographs: Photographs, parameters: NDArray[np.float64], indices: NDArray[np.int64]) -> Lit:
    return open_photographs([photographs.paths[index] for index in indices]), parameters[indices]


def _spread(parameters: NDArray[np.float64]) -> NDArray[np.int64]:
    """All lights in an order whose every beginning is spread over them."""
    u, v = parameters.T
    lights = np.column_stack([u, v, np.sqrt(np.maximum(1 - u * u - v * v, 0))])
    order = [int(np.argmax(lights[:, 2]))]
    nearest = np.full(len(lights), np.inf)
    while len(order) < len(lights):
        nearest = np.minimum(nearest, np.linalg.norm(lights - lights[order[-1]], axis=1))
        nearest[order] = -1
        order.append(int(np.argmax(nearest)))
    return np.array(order)
