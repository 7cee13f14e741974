"""`python -m benchmarks.readme`: the tables of README.md and of pages in docs, from benchmarks/results/results.json."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).with_name("results") / "results.json"
ROOT = Path(__file__).resolve().parents[1]
README, PTM_PAGE, WALK_PAGE, ROOMS_PAGE = (
    ROOT / page for page in ("README.md", "docs/ptm.md", "docs/walk.md", "docs/rooms.md")
)
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

    def faster(row: str) -> str:
        still, moving = (value("frames", row, column) for column in ("speed_up", "moving_speed_up"))
        return f"{still:.0f}x faster standing still, {moving:.0f}x while the viewer moves"

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
         faster("1")),
        ("100 dragons 60 pixels high", faster("100")),
        ("Impostors against the same quads with one plain fetch, 100 objects",
         f"{value('fill', '100', 'still_ratio'):.2f}x; {value('fill', '100', 'relit_ratio'):.1f}x when every light "
         "changes every frame"),
        ("10,000 copies of 8 objects against the same quads with one plain fetch",
         f"{value('crowd', '10000', 'still_ratio'):.2f}x; a moving sun adds "
         f"{100 * (value('crowd', '10000', 'sun_ratio') - 1):.0f} %; "
         f"{value('crowd', '10000', 'cpu_ms'):.0f} ms of CPU"),
        ("Fitting a PTM, 49 photographs of 1920x1280, against only decoding them",
         f"{value('ptm_fit', 'gray objects lrgb', 'ratio'):.2f}x, "
         f"{value('ptm_fit', 'gray objects lrgb', 'peak_gb'):.2f} GB"),
        ("100 lights against 1, once the colormap is written", f"{value('lights', '100', 'still_ratio'):.2f}x"),
    ]  # fmt: skip
    return "\n".join(["| | |", "|---|---|", *(f"| {label} | {text} |" for label, text in lines)]) + "\n"


def ptm_table(results: dict[str, Any]) -> str:
    """The lines of the tables of formats, of lights and of fitters, as Markdown."""
    formats, lights, peers = (results[MACHINE]["tables"][f"ptm_{name}"] for name in ("formats", "lights", "peers"))
    lines = [f"| format | {' | '.join(formats['columns'].values())} |", "|---|" + "---:|" * len(formats["columns"])]
    for row in formats["rows"].values():
        cells = (_cell(row["values"].get(key), ".1f") for key in formats["columns"])
        lines.append(f"| {row['label']} | {' | '.join(cells)} |")
    lines += ["", f"| lights | {' | '.join(lights['rows'])} |", "|---|" + "---:|" * len(lights["rows"])]
    for key, label in lights["columns"].items():
        cells = (_cell(row["values"][key], ".1f") for row in lights["rows"].values())
        lines.append(f"| {label} | {' | '.join(cells)} |")
    shown = {"seconds": ".1f", "speed": ".2f", "psnr_db": "+.2f", "planes": ".0f", "megabytes": ".1f"}
    lines += ["", f"| fitter | {' | '.join(peers['columns'][key] for key in shown)} |", "|---|" + "---:|" * len(shown)]
    for row in peers["rows"].values():
        cells = (_cell(row["values"][key], digits) for key, digits in shown.items())
        lines.append(f"| {row['label']} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def walk_table(results: dict[str, Any]) -> str:
    """The lines of the tables of a frame's parts and of what switches in a flight, as Markdown."""
    tables = results[MACHINE]["tables"]
    passes, flight = tables["passes"], tables["flight"]
    scenes = {key.removesuffix("_ms"): label.removesuffix(", ms") for key, label in passes["columns"].items()}
    scenes = {key: label for key, label in scenes.items() if not key.endswith("%")}
    lines = [f"| part of a frame | {' | '.join(scenes.values())} |", "|---|" + "---:|" * len(scenes)]
    for row in passes["rows"].values():
        cells = (_share(row["values"], key) for key in scenes)
        lines.append(f"| {row['label']} | {' | '.join(cells)} |")
    kinds = {"pop_max": "largest pop", "pop_99": "99 %", "rise_max": "largest rise", "spike_max": "largest spike"}
    lines += ["", f"| the flight as | {' | '.join(kinds.values())} |", "|---|" + "---:|" * len(kinds)]
    for row in flight["rows"].values():
        cells = (f"{row['values'][key]:.1f}" for key in kinds)
        lines.append(f"| {row['label']} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def rooms_table(results: dict[str, Any]) -> str:
    """The lines of the table of fans against meshes in the same surroundings, as Markdown."""
    rows = results[MACHINE]["tables"]["environment_quality"]["rows"]
    lines = ["| PSNR, dB, at the fan's views | in a far room | in a box |", "|---|---:|---:|"]
    for key, row in rows.items():
        name, place, surface = key.split("/")
        if place == "far":
            far, box = (rows[f"{name}/{each}/{surface}"]["values"]["at_views_db"] for each in ("far", "box"))
            label = row["label"].replace(", far", "")
            lines.append(f"| {label} | {far:.1f} | {box:.1f} |")
    return "\n".join(lines) + "\n"


def _cell(value: float | None, digits: str) -> str:
    return "" if value is None else f"{value:{digits}}"


def _share(values: dict[str, float], scene: str) -> str:
    milliseconds, share = values[f"{scene}_ms"], values[f"{scene}_%"]
    return f"{milliseconds:,.0f}" if share is None else f"{milliseconds:,.1f} ms, {share:.0f} %"


def with_table(page: str, made: str) -> str:
    """A page's text with its table made anew."""
    before, rest = page.split(START)
    return before + START + made + END + rest.split(END)[1]


PAGES = ((README, table), (PTM_PAGE, ptm_table), (WALK_PAGE, walk_table), (ROOMS_PAGE, rooms_table))


def main() -> None:
    """Write all pages."""
    results = json.loads(RESULTS.read_text())
    for page, make in PAGES:
        page.write_text(with_table(page.read_text(), make(results)))


if __name__ == "__main__":
    main()
