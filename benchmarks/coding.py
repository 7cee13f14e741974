"""Table "coding": dithering a fan's normals, and cutting its silhouettes into strips."""

from __future__ import annotations

import numpy as np

from benchmarks.exact_normals import exact_layers
from benchmarks.tables import Bar, Row, Table
from benchmarks.timing import alternate
from benchmarks.workbench import Workbench
from impostor.normal_code import dither, encode
from impostor.strips import silhouette_strips


def run(bench: Workbench) -> Table:
    """Measure on all views of the dragon."""
    subject, fan = bench.subject("dragon"), bench.fan("dragon")
    layers, mask = exact_layers(bench.model("dragon"), fan)
    times = alternate(lambda: dither(layers.normal, mask), lambda: encode(layers.normal, mask), repeats=3, warm_up=1)
    columns = {"value": "measured", "quads": "quads a silhouette"}
    table = Table(
        "coding", f"Coding {len(fan.views)} views of {fan.size} x {fan.size} texels: {subject.label}", columns
    )
    table.rows.append(Row("dither_seconds", "dither, s", {"value": times.median(0)}, (Bar("value", "<", 2),)))
    table.rows.append(Row("encode_seconds", "encode without dither, s", {"value": times.median(1)}))

    def cut():
        return [silhouette_strips(silhouette) for silhouette in fan.silhouette]

    seconds = alternate(cut, repeats=5, warm_up=1).median(0) / len(fan.views)
    quads = float(np.mean([len(strips.quads) for strips in cut()]))
    table.rows.append(Row("strips_ms", "strips of a silhouette, ms", {"value": seconds * 1e3, "quads": quads}))
    return table
