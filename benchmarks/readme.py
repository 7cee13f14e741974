"""`python -m benchmarks.readme`: the README's table, made from benchmarks/results/results.json."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).with_name("results") / "results.json"
README = Path(__file__).resolve().parents[1] / "README.md"
START, END = "<!-- table from benchmarks/results -->\n", "<!-- end of table -->\n"
MACHINE = "software-gl"


def table(results: dict[str, Any]) -> str:
    """The lines of the README's table, as Markdown."""
    tables = results[MACHINE]["tables"]

    def value(name: str, row: str, column: str) -> float:
        return tables[name]["rows"][row]["values"][column]

    def baked(column: str) -> float:
        return value("bake", "dragon", column)

    def picture(key: str) -> str:
        decibels, iou = value("quality", f"{key}/0", "psnr_db"), value("quality", f"{key}/0", "iou")
        exact = value("quality", f"{key}/exact", "psnr_db")
        return f"{decibels:.1f} dB, silhouette IoU {iou:.3f} ({exact:.1f} dB with exact normals)"

    lines = [
        ("Bake: dragon scan, 871,306 triangles, 96 views of 256", f"{baked('seconds'):.0f} s, "
         f"{baked('peak_gb'):.2f} GB; capture {baked('pass_ratio'):.2f}x a raw pass"),
        ("Its `.fan`", f"{value('files', 'dragon', 'bytes_a_texel'):.2f} bytes a covered texel, "
         f"loads in {value('files', 'dragon', 'read_seconds'):.2f} s"),
        ("Against the mesh, between the baked views: dragon", picture("dragon")),
        ("bunny", picture("bunny")),
        ("DamagedHelmet, textured", picture("helmet")),
        ("a tree of leaf cards", picture("leaves")),
        ("Impostor + shadow against the mesh, 1280x720: 1 dragon 400 pixels high",
         f"{value('frames', '1', 'speed_up'):.0f}x faster"),
        ("100 dragons 60 pixels high", f"{value('frames', '100', 'speed_up'):.0f}x faster"),
        ("Impostors against the same quads with one plain fetch, 100 objects",
         f"{value('fill', '100', 'still_ratio'):.2f}x; {value('fill', '100', 'relit_ratio'):.1f}x when every light "
         "changes every frame"),
        ("100 lights against 1, once the colormap is written", f"{value('lights', '100', 'still_ratio'):.2f}x"),
    ]  # fmt: skip
    return "\n".join(["| | |", "|---|---|", *(f"| {label} | {text} |" for label, text in lines)]) + "\n"


def with_table(readme: str, results: dict[str, Any]) -> str:
    """The README's text with its table made anew."""
    before, rest = readme.split(START)
    return before + START + table(results) + END + rest.split(END)[1]


if __name__ == "__main__":
    README.write_text(with_table(README.read_text(), json.loads(RESULTS.read_text())))
