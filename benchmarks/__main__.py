"""`python -m benchmarks`: measures, prints what was missed, writes benchmarks/results."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from pathlib import Path

from benchmarks import (
    baking,
    coding,
    crowd,
    environment,
    files,
    flight,
    frames,
    lighting,
    loading,
    overhead,
    passes,
    ptm,
    ptm_choices,
    ptm_peers,
    quality,
    report,
    surfaces,
    weight,
)
from benchmarks.tables import Table
from benchmarks.workbench import DATA, Workbench, say

TABLES: dict[str, Callable[[Workbench], Table]] = {
    "bake": baking.run,
    "files": files.run,
    "frames": frames.run_frames,
    "fill": frames.run_fill,
    "lights": lighting.run_lights,
    "colormap": lighting.run_colormap,
    "environment": environment.run_frames,
    "environment_rewrite": environment.run_rewrite,
    "environment_quality": environment.run_quality,
    "overhead": overhead.run,
    "crowd": crowd.run,
    "passes": passes.run,
    "flight": flight.run,
    "weight": weight.run,
    "loading": loading.run,
    "coding": coding.run,
    "quality": quality.run,
    "surfaces": surfaces.run,
    "ptm": ptm.run_quality,
    "ptm_fit": ptm.run_fit,
    "ptm_formats": ptm_choices.run_formats,
    "ptm_lights": ptm_choices.run_lights,
    "ptm_peers": ptm_peers.run,
}


def main() -> int:
    """Run the tables that are asked for; 1 if one of them could not be made."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--only", metavar="TABLE,...", help=f"some of {', '.join(TABLES)}")
    parser.add_argument("--output", type=Path, default=Path(__file__).with_name("results"), metavar="FOLDER")
    options = parser.parse_args()
    chosen = options.only.split(",") if options.only else list(TABLES)
    unknown = [name for name in chosen if name not in TABLES]
    if unknown:
        parser.error(f"--only {','.join(unknown)}; expected some of {', '.join(TABLES)}")
    if not DATA.is_dir():
        say("no real models (IMPOSTOR_DATA names their folder): sample_models stand in for them, without bars")
    made, failed = [], []
    with tempfile.TemporaryDirectory(prefix="impostor-bench-") as folder:
        bench = Workbench(Path(folder))
        for name in chosen:
            say(f"table {name}")
            started = time.monotonic()
            try:
                with bench.ctx:  # a table before may have left another current, or none
                    made.append(TABLES[name](bench))
            except Exception:
                traceback.print_exc()
                failed.append(name)
            say(f"table {name} took {time.monotonic() - started:.0f} s")
        if made:
            say(f"wrote {report.write(options.output, report.machine(bench.ctx), made)}")
    missed = [f"{table.name}: {row.label}" for table in made for row in table.rows if row.passed is False]
    for line in missed:
        say(f"bar not kept: {line}")
    for name in failed:
        say(f"table failed: {name}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
