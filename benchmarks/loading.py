"""Table "loading": from the start of a process to its first picture."""

from __future__ import annotations

import json
import sys

import numpy as np

from benchmarks.fresh_process import run_fresh
from benchmarks.tables import Row, Table
from benchmarks.workbench import Workbench

REPEATS = 5
STEPS = {
    "import": "import, s",
    "read": "read the fan, s",
    "context": "context and shaders, s",
    "upload": "upload, s",
    "draw": "first frame, s",
    "save": "PNG, s",
}


def run(bench: Workbench) -> Table:
    """Measure the fans of all models."""
    table = Table("loading", "From process start to first picture", {"total": "in all, s", **STEPS})
    for key in ("dragon", "helmet", "tree"):
        bench.fan(key)
        picture = bench.folder / "first.png"
        command = [sys.executable, "-m", "benchmarks.first_picture", str(bench.fan_path(key)), str(picture)]
        costs = [run_fresh(command) for _ in range(REPEATS)]
        steps = [json.loads(cost.output) for cost in costs]
        values: dict[str, float | None] = {"total": float(np.median([cost.seconds for cost in costs]))}
        values |= {step: float(np.median([taken[step] for taken in steps])) for step in STEPS}
        table.rows.append(Row(key, bench.subject(key).label, values))
    table.notes.append("One impostor with its shadow at 1280 x 720; in all: with the start and the end of Python.")
    return table
