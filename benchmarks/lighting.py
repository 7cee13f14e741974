"""Tables "lights" and "colormap": what many lights cost a frame, and what rewriting the colormap costs."""

from __future__ import annotations

from functools import partial

import numpy as np

from benchmarks.scenes import AMBIENT, Field, lights
from benchmarks.tables import Bar, Row, Table
from benchmarks.timing import alternate
from benchmarks.workbench import Workbench
from impostor.lighting import colormap
from impostor.views import ring_bases
from runtime.fans.colormap_pass import ROW_DTYPE, ColormapPass
from runtime.lights.light_table import LightTable

COUNTS = (1, 10, 100)


def run_lights(bench: Workbench) -> Table:
    """Frames of 100 objects under 1, 10 and 100 lights."""
    columns = {
        "lights": "lights",
        "still_ms": "lights still, ms",
        "still_ratio": "of the frame with 1 light",
        "relit_ms": "lights change, ms",
    }
    table = Table("lights", "100 objects of 60 pixels under many lights", columns)
    fields = []
    for count in COUNTS:
        fields.append(Field(bench.ctx, bench.fan("dragon"), 100, 60))
        fields[-1].renderer.lights = lights(count)
    still = alternate(*(field.impostors for field in fields), ctx=bench.ctx)
    relit = alternate(*(field.impostors_relit for field in fields), ctx=bench.ctx)
    for index, count in enumerate(COUNTS):
        values = {
            "lights": count,
            "still_ms": still.median(index) * 1e3,
            "still_ratio": still.ratio(index, 0),
            "relit_ms": relit.median(index) * 1e3,
        }
        bars = (Bar("still_ratio", "<", 1.05),) if count == 100 else ()
        table.rows.append(Row(str(count), _many(count, "light"), values, bars))
    for field in fields:
        field.release()
    table.notes.append(
        "Impostors without shadows. Once a colormap is written, a pixel does not know how many lights it had."
    )
    return table


def run_colormap(bench: Workbench) -> Table:
    """225 entries a row: on the GPU and in NumPy."""
    columns = {"lights": "lights", "rows": "rows", "gpu_ms": "GPU path, ms", "numpy_ms": "NumPy, ms"}
    table = Table("colormap", "Rewriting the colormap: one row for each object and view", columns)
    colormaps, light_table = ColormapPass(bench.ctx), LightTable(bench.ctx)
    for light_count in COUNTS:
        held = lights(light_count)
        light_table.update(held, AMBIENT)
        for row_count in (1, 100, 1000):
            bases = ring_bases(row_count, np.radians(15))
            rows = np.zeros(row_count, ROW_DTYPE)
            rows["row"], rows["basis"] = np.arange(row_count), bases
            jobs = (partial(colormaps.write, rows, light_table), partial(colormap, bases, held, AMBIENT))
            gpu, numpy = (alternate(job, ctx=ctx) for job, ctx in zip(jobs, (bench.ctx, None), strict=True))
            values = {
                "lights": light_count,
                "rows": row_count,
                "gpu_ms": gpu.median(0) * 1e3,
                "numpy_ms": numpy.median(0) * 1e3,
            }
            table.rows.append(
                Row(f"{light_count}x{row_count}", f"{_many(light_count, 'light')}, {_many(row_count, 'row')}", values)
            )
    light_table.release()
    colormaps.release()
    return table


def _many(count: int, word: str) -> str:
    return f"{count:,} {word}{'s' * (count != 1)}"
