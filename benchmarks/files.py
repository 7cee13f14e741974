"""Table "files": how large fans are and how soon they are loaded."""

from __future__ import annotations

from benchmarks.tables import Bar, Row, Table
from benchmarks.timing import alternate
from benchmarks.workbench import Workbench
from impostor.files.fan_file import read_fan

LIMITS = {"dragon": 4.0, "helmet": 6.0}  # bytes a covered texel


def run(bench: Workbench) -> Table:
    """Measure the files of all models."""
    columns = {
        "megabytes": "file, MB",
        "covered_texels": "covered texels, million",
        "bytes_a_texel": "bytes a covered texel",
        "read_seconds": "read, s",
    }
    table = Table("files", "Fan files", columns)
    for key in ("dragon", "bunny", "helmet", "leaves", "tree"):
        subject, fan, path = bench.subject(key), bench.fan(key), bench.fan_path(key)
        size = path.stat().st_size
        values = {
            "megabytes": size / 1e6,
            "covered_texels": fan.covered_texels / 1e6,
            "bytes_a_texel": size / fan.covered_texels,
            "read_seconds": alternate(lambda path=path: read_fan(path), warm_up=1).median(0),
        }
        bars = [Bar("bytes_a_texel", "<=", LIMITS[key])] if key in LIMITS else []
        bars += [Bar("read_seconds", "<", 0.6)] if key == "dragon" else []
        table.rows.append(Row(key, subject.label, values, tuple(bars) if subject.real else ()))
    return table
