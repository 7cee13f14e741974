"""A line chart on two logarithmic or linear axes, drawn with Pillow."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from PIL import Image, ImageDraw, ImageFont

WIDTH, HEIGHT = 960, 600
LEFT, TOP, RIGHT, BOTTOM = 90, 60, 230, 70
SCALE = 2  # drawn this much larger and shrunk, for smooth lines
COLORS = ("#b5442e", "#1f5fa8", "#4a9ad4", "#8a8a8a", "#3f8f4f", "#8a5fb0")
INK, GRID = "#222222", "#dddddd"


def line_chart(
    series: Mapping[str, Sequence[tuple[float, float]]], x_label: str, y_label: str, title: str, linear: bool = False
) -> Image.Image:
    """Draw series of points; on logarithmic axes they have positive coordinates.

    Parameters
    ----------
    series : dict
        Label to points (x, y).
    x_label, y_label, title : str
    linear : bool
        Both axes, from 0 on; then the points themselves are not marked.

    Returns
    -------
    PIL.Image.Image
        960 x 600 pixels.
    """
    axis = _steps if linear else _decades
    x_ticks, y_ticks = (axis([point[along] for points in series.values() for point in points]) for along in (0, 1))
    image = Image.new("RGB", (WIDTH * SCALE, HEIGHT * SCALE), "white")
    draw = ImageDraw.Draw(image)
    font, large = (ImageFont.load_default(points * SCALE) for points in (15, 18))
    box = (LEFT, TOP, WIDTH - RIGHT, HEIGHT - BOTTOM)

    def part(value: float, ticks: Sequence[float]) -> float:
        low, high, value = (each if linear else math.log10(each) for each in (ticks[0], ticks[-1], value))
        return (value - low) / (high - low)

    def place(x: float, y: float) -> tuple[float, float]:
        across, up = part(x, x_ticks), part(y, y_ticks)
        return (box[0] + across * (box[2] - box[0])) * SCALE, (box[3] - up * (box[3] - box[1])) * SCALE

    for tick in x_ticks:
        x, bottom = place(tick, y_ticks[0])
        draw.line([(x, bottom), (x, box[1] * SCALE)], GRID, SCALE)
        draw.text((x, bottom + 8 * SCALE), _tick(tick), INK, font, "ma")
    for tick in y_ticks:
        left, y = place(x_ticks[0], tick)
        draw.line([(left, y), (box[2] * SCALE, y)], GRID, SCALE)
        draw.text((left - 8 * SCALE, y), _tick(tick), INK, font, "rm")
    for points, color in zip(series.values(), COLORS, strict=False):
        path = [place(x, y) for x, y in points]
        draw.line(path, color, (1 if linear else 3) * SCALE, joint="curve")
        for x, y in () if linear else path:
            draw.ellipse([x - 5 * SCALE, y - 5 * SCALE, x + 5 * SCALE, y + 5 * SCALE], color)
    _label(draw, font, {label: place(*points[-1]) for label, points in series.items()})
    middle = (box[0] + box[2]) / 2 * SCALE
    draw.text((middle, (HEIGHT - 20) * SCALE), x_label, INK, font, "ms")
    draw.text((10 * SCALE, (TOP - 12) * SCALE), y_label, INK, font, "ls")
    draw.text((WIDTH / 2 * SCALE, 10 * SCALE), title, INK, large, "ma")
    return image.resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)


def _label(
    draw: ImageDraw.ImageDraw,
    font: ImageFont.FreeTypeFont | ImageFont.ImageFont,
    ends: Mapping[str, tuple[float, float]],
) -> None:
    """Write each series' name behind its end, none over another."""
    line, last = 20 * SCALE, -math.inf
    colors = dict(zip(ends, COLORS, strict=False))
    for label, (x, y) in sorted(ends.items(), key=lambda end: end[1][1]):
        last = max(y, last + line)
        draw.text((x + 12 * SCALE, last), label, colors[label], font, "lm")


def _tick(value: float) -> str:
    return f"{value:,.0f}" if value >= 1 else f"{value:g}"


def _decades(values: Sequence[float]) -> list[float]:
    low, high = math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)))
    return [10.0**power for power in range(low, max(high, low + 1) + 1)]


def _steps(values: Sequence[float]) -> list[float]:
    """From 0 past the largest in 4 to 10 round steps."""
    rough = max(max(values), 1e-9) / 5
    unit = 10.0 ** math.floor(math.log10(rough))
    step = unit * max(each for each in (1, 2, 5) if each * unit <= rough)
    return [step * index for index in range(math.ceil(max(values) / step) + 1)]
