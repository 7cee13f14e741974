"""Measures what views, tile size and elevation give and cost: `python -m docs.choosing [--redraw]`.

Writes docs/choosing.json, plots of it into docs/figures and tables of it into docs/choosing.md. With --redraw the
numbers are those that the JSON has already.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from bake.fan import bake_fan
from docs.studio import INK, PAPER, Studio, font
from impostor.fan import Fan
from impostor.files.fan_file import write_fan
from runtime.compare import Comparison, errors

FOLDER = Path(__file__).parent
RESULTS, PAGE = FOLDER / "choosing.json", FOLDER / "choosing.md"
MODELS = ("statue", "tree")
VIEWS, VIEWS_SIZE = (12, 24, 48, 96, 192), 128
SIZES, SIZES_VIEWS = (32, 64, 128, 256, 512), 48
SCREEN = 256  # pixels that the object is high when views and sizes are measured
RINGS, OTHERS = (0.0, 15.0, 30.0), (("hemisphere", 96), ("hemisphere", 384))
ELEVATIONS = (0.0, 5.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0)
CAMERAS = 16  # for each elevation
GOLDEN = (5**0.5 - 1) / 2  # turns from one to the next: they fall at every fraction of the gap between any views
COLORS = ("#b5442e", "#1f5fa8", "#3f8f4f", "#8a5fb0", "#8a8a8a")
PANEL, MARGIN, SCALE = (330, 250), (58, 44, 14, 44), 2  # pixels; left, top, right, bottom; drawn larger and shrunk


def baked(studio: Studio, name: str, **settings: Any) -> tuple[Fan, dict[str, float]]:
    """A fan with its cost: processor seconds to bake it, of all cores together, and megabytes on disk."""
    model = studio.model(name)
    # The first bake of a process compiles shaders.
    bake_fan(model, views=1, size=32)
    start = time.process_time()
    fan = bake_fan(model, **settings)
    seconds = time.process_time() - start
    with tempfile.TemporaryDirectory() as folder:
        write_fan(Path(folder) / "it.fan", fan)
        megabytes = (Path(folder) / "it.fan").stat().st_size / 1e6
    return fan, {"bake_seconds": round(seconds, 3), "megabytes": round(megabytes, 3)}


def quality(studio: Studio, name: str, fan: Fan, elevations_deg: Sequence[float]) -> list[dict[str, float]]:
    """Mean PSNR and silhouette IoU against the mesh from each elevation, at azimuths between the views."""
    comparison = Comparison(studio.ctx, fan, studio.model(name), SCREEN)
    rows = []
    try:
        for elevation_deg in elevations_deg:
            azimuths = np.arange(1, CAMERAS + 1) * 2 * np.pi * GOLDEN
            found = [errors(comparison.pair(azimuth, np.radians(elevation_deg))) for azimuth in azimuths]
            psnr_db, _, _, iou = np.mean(found, axis=0).tolist()
            rows.append({"elevation_deg": elevation_deg, "psnr_db": round(psnr_db, 2), "iou": round(iou, 4)})
    finally:
        comparison.release()
    return rows


def read_results() -> dict[str, Any]:
    """What was measured last."""
    return json.loads(RESULTS.read_text())


def measure(studio: Studio) -> dict[str, Any]:
    """All that the page says."""
    result: dict[str, Any] = {"views": {}, "size": {}, "elevation": {}}
    for name in MODELS:
        for key, settings in _sweeps():
            fan, cost = baked(studio, name, **settings)
            row = {key: settings[key], **cost, **quality(studio, name, fan, (15.0,))[0]}
            result[key].setdefault(name, []).append(row)
            print(f"{name}: {row}", file=sys.stderr)
        for label, settings in _layouts():
            fan, cost = baked(studio, name, size=VIEWS_SIZE, **settings)
            rows = quality(studio, name, fan, ELEVATIONS)
            result["elevation"].setdefault(name, {})[label] = {**cost, "rows": rows}
            print(f"{name}, {label}: {[round(row['psnr_db'], 1) for row in rows]}", file=sys.stderr)
    return result


def _sweeps() -> Iterator[tuple[str, dict[str, Any]]]:
    for views in VIEWS:
        yield "views", {"views": views, "size": VIEWS_SIZE}
    for size in SIZES:
        yield "size", {"views": SIZES_VIEWS, "size": size}


def _layouts() -> Iterator[tuple[str, dict[str, Any]]]:
    for elevation in RINGS:
        yield f"ring at {elevation:.0f}°, 96 views", {"views": 96, "elevation_deg": elevation}
    for layout, views in OTHERS:
        yield f"{layout}, {views} views", {"views": views, "layout": layout}


def tables(results: Mapping[str, Any]) -> dict[str, str]:
    """Markdown of every table on the page, by the name it has there."""
    made = {}
    for key, title in (("views", "views"), ("size", "tile size")):
        rows = zip(*(results[key][name] for name in MODELS), strict=True)
        lines = [
            f"| {title} | {' | '.join(MODELS)} | .fan | bake |",
            "|---|---|---|---|---|",
            *(
                f"| {each[0][key]} | {' | '.join(_picture(row) for row in each)} | {_both(each, 'megabytes', 'MB')} | "
                f"{_both(each, 'bake_seconds', 's')} |"
                for each in rows
            ),
        ]
        made[key] = "\n".join(lines) + "\n"
    for name in MODELS:
        lines = [f"| seen from | {' | '.join(f'{angle:.0f}°' for angle in ELEVATIONS)} |", "|---" * 9 + "|"]
        for label, entry in results["elevation"][name].items():
            cells = (f"{row['psnr_db']:.1f}" for row in entry["rows"])
            lines.append(f"| {label} | {' | '.join(cells)} |")
        made[f"elevation of {name}"] = "\n".join(lines) + "\n"
    return made


def words(results: Mapping[str, Any]) -> dict[str, str]:
    """What the tables show, in sentences, by the name each has on the page."""

    def psnr(key: str, name: str, value: int) -> float:
        return next(row["psnr_db"] for row in results[key][name] if row[key] == value)

    def both(gain: Callable[[str], float]) -> str:
        return " and ".join(f"{gain(name):.1f}" for name in MODELS) + " dB"

    def seen(name: str, label: str, elevation_deg: float) -> float:
        rows = results["elevation"][name][label]["rows"]
        return next(row["psnr_db"] for row in rows if row["elevation_deg"] == elevation_deg)

    ring, few, many = "ring at 15°, 96 views", "hemisphere, 96 views", "hemisphere, 384 views"
    views = [
        both(lambda n, a=a, b=b: psnr("views", n, b) - psnr("views", n, a)) for a, b in ((12, 48), (48, 96), (96, 192))
    ]
    size = [
        both(lambda n, a=a, b=b: psnr("size", n, b) - psnr("size", n, a))
        for a, b in ((32, 128), (128, 256), (256, 512))
    ]
    lost = [both(lambda n, e=e: seen(n, ring, 15) - seen(n, ring, e)) for e in (20, 30, 45)]
    at_home = both(lambda n: seen(n, ring, 15) - seen(n, few, 15))
    away, dense = (both(lambda n, label=label: seen(n, label, 45) - seen(n, ring, 45)) for label in (few, many))
    return {
        "views in words": f"Statue and tree gain {views[0]} from 12 views to 48, {views[1]} from there to 96, and "
        f"{views[2]} from there to 192. File and bake grow with the number.\n",
        "size in words": f"Statue and tree gain {size[0]} from tiles of 32 to 128, {size[1]} from there to 256, "
        f"which is the size on screen, and {size[2]} from there to 512.\n",
        "elevation in words": f"A ring at 15° that is seen 5° higher loses {lost[0]} on statue and tree, 15° higher "
        f"{lost[1]}, and 30° higher {lost[2]}. At its own elevation it is better than a hemisphere of as many views by "
        f"{at_home}; at 45° the hemisphere is better by {away}, and one of four times as many views by {dense}.\n",
    }


def _picture(row: Mapping[str, float]) -> str:
    return f"{row['psnr_db']:.1f} dB, {row['iou']:.3f}"


def _both(rows: Sequence[Mapping[str, float]], key: str, unit: str) -> str:
    return ", ".join(f"{row[key]:.2g}" for row in rows) + f" {unit}"


def with_tables(page: str, results: Mapping[str, Any]) -> str:
    """The page's text with its tables and sentences made anew."""
    for name, table in (tables(results) | words(results)).items():
        begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
        page = re.sub(
            f"{re.escape(begin)}.*?{re.escape(end)}", lambda _, b=begin, t=table, e=end: b + t + e, page, flags=re.S
        )
    return page


Lines = Mapping[str, Sequence[tuple[float, float]]]


def panel(lines: Lines, title: str, x_label: str, log_x: bool, log_y: bool) -> Image.Image:
    """Series of points against two axes, each linear or logarithmic."""
    width, height = PANEL
    left, top, right, bottom = MARGIN
    image = Image.new("RGB", (width * SCALE, height * SCALE), PAPER)
    pen, small = ImageDraw.Draw(image), font(11 * SCALE)
    points = np.array([point for series in lines.values() for point in series], float)
    x_ticks, y_ticks = np.unique(points[:, 0]), _ticks(points[:, 1], log_y)
    x_axis, y_axis = _axis(x_ticks, log_x, left, width - right), _axis(y_ticks, log_y, height - bottom, top)
    for y in y_ticks:
        pen.line([(left * SCALE, y_axis(y)), ((width - right) * SCALE, y_axis(y))], "#dddddd", SCALE)
        pen.text(((left - 6) * SCALE, y_axis(y)), f"{y:g}", INK, small, "rm")
    for x in x_ticks:
        pen.text((x_axis(x), (height - bottom + 6) * SCALE), f"{x:g}", INK, small, "ma")
    for color, series in zip(COLORS, lines.values(), strict=False):
        path = [(x_axis(x), y_axis(y)) for x, y in series]
        pen.line(path, color, 2 * SCALE, joint="curve")
        for x, y in path:
            pen.ellipse([x - 3 * SCALE, y - 3 * SCALE, x + 3 * SCALE, y + 3 * SCALE], color)
    pen.text((left * SCALE, (top - 12) * SCALE), title, INK, font(13 * SCALE), "ls")
    pen.text(((left + width - right) / 2 * SCALE, (height - 8) * SCALE), x_label, INK, small, "ms")
    return image.resize(PANEL, Image.Resampling.LANCZOS)


def _ticks(values: np.ndarray, log: bool) -> np.ndarray:
    if log:
        steps = [a * 10.0**b for b in range(-4, 4) for a in (1, 3)]
        low = max(step for step in steps if step <= values.min())
        return np.array([s for s in steps if low <= s and (s <= values.max() or s < values.max() * 3.4)])
    step = next(s for s in (0.01, 0.02, 0.05, 0.1, 1, 2, 5, 10, 20) if np.ptp(values) / s < 6)
    return np.arange(np.floor(values.min() / step), np.ceil(values.max() / step) + 1) * step


def _axis(ticks: np.ndarray, log: bool, start: float, end: float):
    scale = np.log if log else np.asarray
    low, high = scale(ticks.min()), scale(ticks.max())
    return lambda value: float((start + (scale(value) - low) / (high - low) * (end - start)) * SCALE)


def plots(results: Mapping[str, Any]) -> dict[str, Image.Image]:
    """The page's plots by file name."""
    measured = (
        ("psnr_db", "PSNR, dB", False),
        ("megabytes", ".fan, MB", True),
        ("bake_seconds", "bake, CPU seconds", True),
    )
    made = {}
    for key, label in (("views", "number of views"), ("size", "tile size, texels")):
        panels = []
        for field, title, log in measured:
            lines = {name: [(row[key], row[field]) for row in results[key][name]] for name in MODELS}
            panels.append(panel(lines, title, label, True, log))
        made[f"choosing_{key}"] = _page(panels, MODELS)
    panels = []
    for name in MODELS:
        entries = results["elevation"][name].items()
        lines = {label: [(row["elevation_deg"], row["psnr_db"]) for row in each["rows"]] for label, each in entries}
        panels.append(panel(lines, f"{name}: PSNR, dB", "elevation of the camera, degrees", False, False))
    made["choosing_elevation"] = _page(panels, list(results["elevation"][MODELS[0]]))
    return made


def _page(panels: Sequence[Image.Image], labels: Sequence[str]) -> Image.Image:
    """Panels side by side over a legend, which takes as many lines as it needs."""
    width = sum(each.width for each in panels)
    pen = ImageDraw.Draw(Image.new("RGB", (1, 1)))
    spots, x, line = [], 16.0, 0
    for label in labels:
        length = 34 + pen.textlength(label, font(13))
        if x + length > width:
            x, line = 16.0, line + 1
        spots.append((x, panels[0].height + 12 + 20 * line))
        x += length
    page = Image.new("RGB", (width, panels[0].height + 20 * line + 28), PAPER)
    for index, each in enumerate(panels):
        page.paste(each, (sum(other.width for other in panels[:index]), 0))
    pen = ImageDraw.Draw(page)
    for color, label, (x, y) in zip(COLORS, labels, spots, strict=False):
        pen.line([(x, y), (x + 16, y)], color, 3)
        pen.text((x + 21, y), label, INK, font(13), "lm")
    return page


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, and write what the page shows."""
    parser = argparse.ArgumentParser(description="Measure what docs/choosing.md says.")
    parser.add_argument("--redraw", action="store_true", help="take the numbers from docs/choosing.json")
    if not parser.parse_args(arguments).redraw:
        RESULTS.write_text(json.dumps(measure(Studio()), indent=1) + "\n")
    results = read_results()
    for name, picture in plots(results).items():
        picture.quantize(128).save(FOLDER / "figures" / f"{name}.png", optimize=True)
    PAGE.write_text(with_tables(PAGE.read_text(), results))


if __name__ == "__main__":
    main()
