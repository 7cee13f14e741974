"""Table "quality": a fan's pictures against its mesh, and what dithered codes cost beside exact normals."""

from __future__ import annotations

import numpy as np

from benchmarks.exact_normals import exact_layers, lit_exactly, undithered
from benchmarks.tables import Bar, Row, Table
from benchmarks.workbench import Workbench, say
from impostor.fan import Fan
from runtime.compare import Comparison
from runtime.lights.settings import DEFAULT_AMBIENT, DEFAULT_LIGHTS

OFFSETS_DEG = (0, 5, 10, 20, 35)
CAMERAS = 8
LIMITS = {"dragon": 28.0, "bunny": 28.0, "helmet": 26.0}  # dB
LEAST_IOU = 0.97


def run(bench: Workbench) -> Table:
    """Measure all models at all offsets, and the variants at the fan's own elevation."""
    columns = {
        "offset_deg": "degrees off",
        "psnr_db": "PSNR, dB",
        "ssim": "SSIM",
        "flip": "FLIP",
        "iou": "IoU",
    }
    table = Table("quality", "Picture error against the mesh", columns)
    for key in ("dragon", "bunny", "helmet", "leaves", "tree"):
        say(f"quality: {bench.subject(key).path.name}")
        fan, label = bench.fan(key), bench.subject(key).label
        bars = (Bar("psnr_db", ">=", LIMITS.get(key, 0)), Bar("iou", ">=", LEAST_IOU))
        bars = bars if key in LIMITS and bench.subject(key).real else ()
        measured = compare(bench, key, fan, OFFSETS_DEG)
        table.rows.append(Row(f"{key}/0", f"{label}, nearest", measured[0], bars))
        layers, mask = exact_layers(bench.model(key), fan)
        flat = compare(bench, key, undithered(fan, layers, mask), (0,))[0]
        table.rows.append(Row(f"{key}/undithered", f"{label}, codes without dither", flat))
        exact = compare(bench, key, lit_exactly(fan, layers, DEFAULT_LIGHTS, DEFAULT_AMBIENT), (0,), lit=True)[0]
        table.rows.append(Row(f"{key}/exact", f"{label}, exact normals", exact))
        for values in measured[1:]:
            table.rows.append(Row(f"{key}/{values['offset_deg']:g}", f"{label}, nearest", values))
    table.notes.append(
        f"Means over {CAMERAS} orthographic cameras around the object that lie between the baked views, at the tiles' "
        f"own size, under one light of {DEFAULT_LIGHTS[0].color[0]:g} and an ambient of {DEFAULT_AMBIENT:g}; over the "
        "pixels that mesh or impostor touch. The mesh is supersampled 4 x 4. Degrees off: the cameras' elevation above "
        "the fan's."
    )
    return table


def compare(
    bench: Workbench, key: str, fan: Fan, offsets_deg: tuple[float, ...], lit: bool = False
) -> list[dict[str, float | None]]:
    """The errors at each offset; of a fan whose albedo is lit already if `lit`."""
    comparison = Comparison(bench.ctx, fan, bench.model(key))
    if lit:
        comparison._fans.lights, comparison._fans.ambient = (), 1.0
    try:
        rows = [row for row, _ in comparison.rows(offsets_deg, CAMERAS)]
    finally:
        comparison.release()
    names = ("offset_deg", "psnr_db", "ssim", "flip", "iou")
    return [{name: float(np.float64(getattr(row, name))) for name in names} for row in rows]
