"""Table "weight": frames of impostors of a heavy mesh and of a light one of the same shape."""

from __future__ import annotations

import numpy as np

from bake.fan import bake_fan
from benchmarks.scenes import Field
from benchmarks.tables import Bar, Row, Table
from benchmarks.timing import alternate
from benchmarks.workbench import Workbench, say
from impostor.model import Model

COUNT, PIXELS_HIGH = 1000, 30
FEW_TRIANGLES = 5000


def run(bench: Workbench) -> Table:
    """Draw 1,000 copies of both."""
    heavy = bench.model("dragon")
    light = clustered(heavy, FEW_TRIANGLES)
    say("weight: baking the light mesh")
    fields = [Field(bench.ctx, fan, COUNT, PIXELS_HIGH) for fan in (bench.fan("dragon"), bake_fan(light))]
    for field in fields:
        field.impostors_and_shadows()
    times = alternate(*(field.impostors_and_shadows_moving for field in fields), ctx=bench.ctx, repeats=15)
    for field in fields:
        field.release()
    columns = {"triangles": "triangles", "frame_ms": "frame, ms", "ratio": "of the light mesh's frame"}
    table = Table("weight", "What the mesh weighs: 1,000 impostors with shadows, viewer moving", columns)
    for index, (label, model) in enumerate((("scan", heavy), ("the scan, vertices merged", light))):
        values = {
            "triangles": model.triangle_count,
            "frame_ms": times.median(index) * 1e3,
            "ratio": times.ratio(index, 1),
        }
        table.rows.append(Row(label, label, values, (Bar("ratio", "<=", 1.15),) if index == 0 else ()))
    table.notes.append(f"{bench.subject('dragon').label}, {PIXELS_HIGH} pixels high. The bar is this machine's noise.")
    return table


def clustered(model: Model, triangles: int) -> Model:
    """A light model of about the same shape: vertices in one cell of a grid become one."""
    positions = np.concatenate([part.positions for part in model.primitives]).astype(float)
    counts = np.cumsum([0] + [len(part.positions) for part in model.primitives])
    faces = np.concatenate([part.triangles + start for part, start in zip(model.primitives, counts, strict=False)])
    low, high = positions.min(axis=0), positions.max(axis=0)
    found = np.empty((0, 3), int)
    cells = 8
    while len(found) < triangles:
        cells += 2
        keys = np.floor((positions - low) / (high - low).max() * cells).astype(np.int64) @ [1, 1 << 20, 1 << 40]
        _, of_vertex = np.unique(keys, return_inverse=True)
        merged = of_vertex[faces]
        distinct = np.all(merged != np.roll(merged, 1, axis=1), axis=1)
        found = np.unique(np.sort(merged[distinct], axis=1), axis=0, return_index=True)[1]
        found = merged[distinct][found]
    size = np.bincount(of_vertex)
    means = np.stack([np.bincount(of_vertex, positions[:, axis]) / size for axis in range(3)], axis=-1)
    return Model.from_arrays(means, found, name=f"{model.name}, {len(found)} triangles")
