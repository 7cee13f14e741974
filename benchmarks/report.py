"""Results on disk: one results.json for all machines, and a page and a chart for each."""

from __future__ import annotations

import json
import os
import platform
import re
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import moderngl
from PIL import Image

from benchmarks.chart import line_chart
from benchmarks.fresh_process import ROOT
from benchmarks.tables import Table
from impostor.files.output import atomic_output

PACKAGES = ("moderngl", "numpy", "scipy", "Pillow", "pyrender", "trimesh", "scikit-image")
SOFTWARE = ("llvmpipe", "softpipe", "swiftshader")
SERIES = {
    "mesh_ms": "mesh",
    "impostor_shadow_ms": "impostor + shadow",
    "impostor_ms": "impostor",
    "plain_ms": "plain quads",
}


def machine(ctx: moderngl.Context) -> dict[str, Any]:
    """What the numbers depend on."""
    return {
        "renderer": ctx.info["GL_RENDERER"],
        "opengl": ctx.info["GL_VERSION"],
        "cpus": os.cpu_count(),
        "python": platform.python_version(),
        "packages": {name: _version(name) for name in PACKAGES},
    }


def machine_kind(renderer: str) -> str:
    """software-gl, or the renderer's name in lower case with dashes."""
    if any(name in renderer.lower() for name in SOFTWARE):
        return "software-gl"
    return re.sub(r"[^a-z0-9]+", "-", renderer.lower()).strip("-")


def commit() -> str:
    """The commit that is checked out, `+` behind it when files differ from it; unknown outside a repository."""
    try:
        command = ["git", "describe", "--always", "--exclude=*", "--dirty=+"]
        return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def write(folder: Path, found: dict[str, Any], tables: list[Table]) -> Path:
    """Write what was measured; tables that were not measured now stay as they were.

    Parameters
    ----------
    folder : Path
    found : dict
        See `machine`.
    tables : list of Table

    Returns
    -------
    Path
        The page.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path, kind = folder / "results.json", machine_kind(found["renderer"])
    results = json.loads(path.read_text()) if path.exists() else {}
    here = results.setdefault(kind, {"tables": {}})
    here["machine"] = found
    here["tables"] |= {table.name: {"commit": commit(), **table.as_json()} for table in tables}
    with atomic_output(path, force=True) as temporary:
        temporary.write_text(json.dumps(results, indent=1) + "\n")
    frames = here["tables"].get("frames")
    if frames:
        _save(folder / f"{kind}-frames.png", _chart(frames))
    for table in tables:
        if table.chart is not None:
            _save(folder / f"{kind}-{table.name}.png", table.chart)
    page = folder / f"{kind}.md"
    with atomic_output(page, force=True) as temporary:
        temporary.write_text(_page(folder, kind, here))
    return page


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "(not installed)"


def _save(path: Path, chart: Image.Image) -> None:
    with atomic_output(path, force=True) as temporary:
        chart.save(temporary, format="PNG")


def _chart(frames: dict[str, Any]) -> Image.Image:
    rows = sorted((row["values"] for row in frames["rows"].values()), key=lambda values: values["objects"])
    series = {label: [(row["objects"], row[key]) for row in rows] for key, label in SERIES.items()}
    return line_chart(series, "objects", "ms a frame", frames["title"])


def _page(folder: Path, kind: str, here: dict[str, Any]) -> str:
    found, tables = here["machine"], here["tables"]
    packages = ", ".join(f"{name} {number}" for name, number in found["packages"].items())
    lines = [
        f"# Benchmarks: {kind}",
        "",
        f"{found['renderer']}, {found['opengl']}; {found['cpus']} CPUs; Python {found['python']}; {packages}.",
        "",
        "Written by `make bench`. Times are medians of repeated runs that alternate with what they are compared with; "
        "a bar is what the number is held against.",
    ]
    for name, table in tables.items():
        lines += ["", f"## {table['title']}", "", *_markdown(table)]
        lines += ["", *(f"{note}" for note in table["notes"]), f"Commit {table['commit']}."]
        if (folder / f"{kind}-{name}.png").exists():
            lines += ["", f"![{table['title']}]({kind}-{name}.png)"]
    return "\n".join(lines) + "\n"


def _markdown(table: dict[str, Any]) -> list[str]:
    columns, rows = table["columns"], list(table["rows"].values())
    with_bars, with_notes = any(row["bars"] for row in rows), any(row["note"] for row in rows)
    head = ["", *columns.values()] + ["bar", "kept"] * with_bars + [""] * with_notes
    lines = [head, ["---"] + ["---:"] * len(columns) + ["---", "---"] * with_bars + ["---"] * with_notes]
    for row in rows:
        cells = [row["label"], *(_number(row["values"].get(key)) for key in columns)]
        if with_bars:
            bars = (f"{columns[bar['column']]} {bar['relation']} {bar['limit']:g}" for bar in row["bars"])
            cells += ["; ".join(bars), {True: "yes", False: "**no**", None: ""}[row["passed"]]]
        lines.append(cells + [row["note"]] * with_notes)
    return [f"| {' | '.join(line)} |" for line in lines]


def _number(value: float | None) -> str:
    if value is None:
        return ""
    if value == 0 or 0.001 <= abs(value) < 1e6:
        return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}" if abs(value) < 100 else f"{value:.4g}"
    return f"{value:.2e}"
