"""Table "bake": what `impostor bake` costs, and its geometry pass against the bare one."""

from __future__ import annotations

from bake.capture import Capture, default_samples
from benchmarks.raw_pass import RawPass
from benchmarks.tables import Bar, Row, Table
from benchmarks.timing import Times, alternate
from benchmarks.workbench import Workbench

SIZE = 256
TITLE = "Baking: 96 views of 256 x 256 texels"


def run(bench: Workbench) -> Table:
    """Measure the whole command on the models, and the pass of one view on the dragon."""
    columns = {
        "seconds": "`impostor bake`, s",
        "seconds_a_view": "s a view",
        "peak_gb": "peak memory, GB",
        "pass_ms": "geometry pass of a view, ms",
        "raw_pass_ms": "raw pass, ms",
        "pass_ratio": "pass / raw pass",
        "bake_ratio": "whole bake / raw pass",
    }
    table = Table("bake", TITLE, columns)
    for key in ("dragon", "bunny", "helmet", "leaves", "tree"):
        subject, cost = bench.subject(key), bench.bake_cost(key)
        views = len(bench.fan(key).views)
        times = pass_times(bench, key)
        values = {
            "seconds": cost.seconds,
            "seconds_a_view": cost.seconds / views,
            "peak_gb": None if cost.peak_bytes is None else cost.peak_bytes / 1e9,
            "pass_ms": times.median(0) * 1e3,
            "raw_pass_ms": times.median(1) * 1e3,
            "pass_ratio": times.ratio(0, 1),
            "bake_ratio": cost.seconds / views / times.median(1),
        }
        bars = (Bar("seconds", "<", 40), Bar("peak_gb", "<", 2), Bar("pass_ratio", "<=", 1.5))
        bars = bars if key == "dragon" and subject.real else ()
        note = f"{bench.model(key).triangle_count:,} triangles"
        table.rows.append(Row(key, subject.label, values, bars, note))
    table.notes.append(
        "The command runs in a fresh process: start, loading, 96 views, coding and writing. The raw pass is bare "
        "moderngl with the same mesh, shaders, targets and read-back; the two alternate view by view."
    )
    return table


def pass_times(bench: Workbench, key: str) -> Times:
    """Seconds of one view by the bake's capture and by the raw pass."""
    model, views = bench.model(key), bench.fan(key).views
    samples = default_samples(model)
    raw = RawPass(model, SIZE, samples)
    try:
        with Capture(model, SIZE, samples) as capture:
            turns = {"capture": 0, "raw": 0}

            def next_view(who: str):
                turns[who] += 1
                return views[turns[who] * 7 % len(views)]

            return alternate(lambda: capture.view(next_view("capture")), lambda: raw.view(next_view("raw")))
    finally:
        raw.release()
