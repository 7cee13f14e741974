"""A line chart on two logarithmic axes, drawn with Pillow."""

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
    series: Mapping[str, Sequence[tuple[float, float]]], x_label: str, y_label: str, title: str
) -> Image.Image:
    """Draw series of points with positive coordinates.

    Parameters
    ----------
    series : dict
        Label to points (x, y).
    x_label, y_label, title : str

    Returns
    -------
    PIL.Image.Image
        960 x 600 pixels.
    """
    xs = [x for points in series.values() for x, _ in points]
    ys = [y for points in series.values() for _, y in points]
    x_range, y_range = _decades(xs), _decades(ys)
    image = Image.new("RGB", (WIDTH * SCALE, HEIGHT * SCALE), "white")
    draw = ImageDraw.Draw(image)
    font, large = (ImageFont.load_default(points * SCALE) for points in (15, 18))
    box = (LEFT, TOP, WIDTH - RIGHT, HEIGHT - BOTTOM)

    def place(x: float, y: float) -> tuple[float, float]:
        across = (math.log10(x) - x_range[0]) / (x_range[1] - x_range[0])
        up = (math.log10(y) - y_range[0]) / (y_range[1] - y_range[0])
        return (box[0] + across * (box[2] - box[0])) * SCALE, (box[3] - up * (box[3] - box[1])) * SCALE

    for power in range(x_range[0], x_range[1] + 1):
        x, bottom = place(10.0**power, 10.0 ** y_range[0])
        draw.line([(x, bottom), (x, box[1] * SCALE)], GRID, SCALE)
        draw.text((x, bottom + 8 * SCALE), f"{10**power:,}" if power >= 0 else f"{10.0**power:g}", INK, font, "ma")
    for power in range(y_range[0], y_range[1] + 1):
        left, y = place(10.0 ** x_range[0], 10.0**power)
        draw.line([(left, y), (box[2] * SCALE, y)], GRID, SCALE)
        draw.text((left - 8 * SCALE, y), f"{10**power:,}" if power >= 0 else f"{10.0**power:g}", INK, font, "rm")
    for (label, points), color in zip(series.items(), COLORS, strict=False):
        path = [place(x, y) for x, y in points]
        draw.line(path, color, 3 * SCALE, joint="curve")
        for x, y in path:
            draw.ellipse([x - 5 * SCALE, y - 5 * SCALE, x + 5 * SCALE, y + 5 * SCALE], color)
        draw.text((path[-1][0] + 12 * SCALE, path[-1][1]), label, color, font, "lm")
    middle = (box[0] + box[2]) / 2 * SCALE
    draw.text((middle, (HEIGHT - 20) * SCALE), x_label, INK, font, "ms")
    draw.text((10 * SCALE, (TOP - 12) * SCALE), y_label, INK, font, "ls")
    draw.text((WIDTH / 2 * SCALE, 10 * SCALE), title, INK, large, "ma")
    return image.resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)


def _decades(values: Sequence[float]) -> tuple[int, int]:
    low, high = math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)))
    return low, max(high, low + 1)
