"""The cottage's painted atlas: brick, plaster and timber, roof tiles, woodwork."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from paint import blade, mix, noise, ramp, rgb, to_bytes

PIXELS = 100
ATLAS = np.array([1024, 2048])

# Where each part lies: left, top, width, height in pixels; PIXELS to the metre.
REGIONS = {
    "front": (0, 0, 900, 300),
    "back": (0, 304, 900, 300),
    "roof": (0, 608, 960, 490),
    "side": (0, 1102, 560, 624),
    "wing": (564, 1102, 340, 498),
    "cheek": (564, 1604, 130, 300),
    "stack": (698, 1604, 106, 270),
    "glass": (0, 1730, 150, 130),
    "door": (154, 1730, 100, 210),
    "shutter": (258, 1730, 72, 132),
    "cream": (334, 1730, 220, 60),
    "wood": (334, 1794, 220, 60),
    "beam": (334, 1858, 220, 60),
    "stone": (334, 1922, 220, 60),
    "brick": (0, 1944, 150, 100),
    "ridge": (258, 1866, 72, 60),
    "flowers": (258, 1930, 72, 54),
    "leaves": (154, 1944, 96, 54),
    "brass": (258, 1988, 40, 40),
}


def bricks(width: int, height: int, seed: int) -> np.ndarray:
    """Brickwork in running bond, (height, width, 3); bricks of 0.25 m x 0.08 m with their joints."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:height, 0:width] + 0.5
    y = height - y
    course = (y // 8).astype(int)
    along = x + (course % 2) * 12.5
    column = (along // 25).astype(int)
    tint = rng.random((course.max() + 1, column.max() + 2))[course, column]
    tone = rng.normal(1.0, 0.07, (course.max() + 1, column.max() + 2))[course, column]
    image = ramp(tint, ("#8a4a38", "#9c5a42", "#a9664a", "#b3755a", "#94604e")) * tone[..., None]
    image *= 1 + 0.05 * noise((height, width), seed + 1, 0.5)[..., None]
    joint = np.minimum(np.minimum(y % 8, 8 - y % 8), np.minimum(along % 25, 25 - along % 25))
    image = mix(image, rgb("#b8a994"), np.clip(1.35 - joint, 0, 1) * 0.85)
    return image * (1 + 0.05 * noise((height, width), seed + 2, 1.8)[..., None])


def plaster(width: int, height: int, seed: int) -> np.ndarray:
    """Lime plaster."""
    stain = noise((height, width), seed, 1.7)
    return mix(np.broadcast_to(rgb("#e3d7bd"), (height, width, 3)), rgb("#c9b795"), 0.30 + 0.22 * stain)


def boards(width: int, height: int, seed: int, colors: tuple[str, ...]) -> np.ndarray:
    """Wood with its grain along x."""
    grain = noise((height, width), seed, 1.3, (0.10, 1.0)) * 0.17 + noise((height, width), seed + 1, 1.8) * 0.06
    return ramp(0.5 + grain, colors)


def timber(image: np.ndarray, ends: Sequence[tuple[float, float, float, float]], width: float, seed: int) -> None:
    """Paint beams over a wall, in place; ends are x0, y0, x1, y1 in pixels."""
    h, w = image.shape[:2]
    y, x = np.mgrid[0:h, 0:w] + 0.5
    grain = boards(w, h, seed, ("#3b2c21", "#54402f", "#6b533e"))
    for x0, y0, x1, y1 in ends:
        length = np.hypot(x1 - x0, y1 - y0)
        along = ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / length
        across = np.abs((x - x0) * (y1 - y0) - (y - y0) * (x1 - x0)) / length
        on = (along >= 0) & (along <= length)
        shadow = np.clip(1 - (across - width / 2) / 4, 0, 1) * on * 0.30
        image[:] = image * (1 - shadow[..., None])
        image[:] = mix(image, grain, np.clip(width / 2 - across + 0.5, 0, 1) * on)


def stones(width: int, height: int, seed: int) -> np.ndarray:
    """A plinth of rough stones in two courses."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:height, 0:width]
    high = height // 2
    course = np.minimum(y // max(high, 1), 1)
    edges = [np.cumsum(rng.uniform(22, 52, width // 22 + 3)) - 20 for _ in range(2)]
    image = np.zeros((height, width, 3))
    for k in range(2):
        row = course == k
        index = np.searchsorted(edges[k], x)
        near = np.abs(x[..., None] - edges[k]).min(axis=-1)
        tone = rng.normal(1.0, 0.09, len(edges[k]) + 1)[index]
        stone = ramp(rng.random(len(edges[k]) + 1)[index], ("#8b8272", "#a0968a", "#948d80")) * tone[..., None]
        joint = np.minimum(near, np.minimum(y % high, high - y % high))
        stone = mix(stone, rgb("#6c6459"), np.clip(1.6 - joint, 0, 1) * 0.8)
        image[row] = stone[row]
    return image * (1 + 0.07 * noise((height, width), seed + 1, 1.2)[..., None])


def weather(image: np.ndarray, eaves: int, seed: int) -> np.ndarray:
    """Shade under the eaves, damp at the foot, soft stains."""
    h, w = image.shape[:2]
    up = h - np.arange(h)[:, None] + np.zeros(w)
    under = np.clip(1 - (eaves - up) / 70, 0, 1) * (up <= eaves) * 0.38
    foot = np.clip(1 - up / 55, 0, 1) * (0.30 + 0.12 * noise((h, w), seed, 1.8))
    return image * (1 - under[..., None]) * (1 - np.clip(foot, 0, 0.5)[..., None])


def ivy(image: np.ndarray, stems: list[tuple[float, float, float]], seed: int) -> None:
    """Climb ivy over a wall, in place; a stem is x, height reached and spread, in pixels."""
    rng = np.random.default_rng(seed)
    h, w = image.shape[:2]
    canvas = np.dstack([image, np.ones((h, w))])
    leaves = []
    for x, reach, spread in stems:
        count = int(reach * spread / 26)
        t = rng.random(count) ** 1.35
        offset = rng.normal(0, 1, count) * spread * (1 - 0.75 * t) * (0.75 + 0.4 * np.sin(7 * t + x))
        leaves += list(zip(x + offset + 14 * np.sin(5 * t), h - t * reach, rng.random(count), strict=True))
    for x, y, _ in leaves:
        canvas[max(int(y) - 3, 0) : int(y) + 8, max(int(x) - 4, 0) : int(x) + 7, :3] *= 0.94
    for x, y, shade in leaves:
        angle = rng.uniform(-1.3, 1.3)
        tip = np.array([x + 10 * np.sin(angle), y + 10 * np.cos(angle)])
        blade(canvas, np.array([x, y]), tip, 8.5, rgb("#56702f") * (0.55 + 0.65 * shade), veins=0.7)
    image[:] = canvas[..., :3]


def gable(width: int, height: int, eaves: int, seed: int) -> np.ndarray:
    """Brick below, plaster and timber above."""
    image = np.concatenate([plaster(width, height - eaves, seed), bricks(width, eaves, seed + 3)])
    top = height - eaves
    half, step = width / 2, width / 8
    beams = [(half + k * step, top, half + k * step, 0) for k in range(-3, 4)]
    beams += [(0, top - 2, width, top - 2), (0, top * 0.52, width, top * 0.52)]
    beams += [
        (half - 3 * step, top, half - 1.2 * step, top * 0.52),
        (half + 3 * step, top, half + 1.2 * step, top * 0.52),
    ]
    timber(image, beams, 17, seed + 5)
    return image


def tiles(width: int, height: int, seed: int) -> np.ndarray:
    """Clay roof tiles with rounded lower ends, 0.18 m wide, courses of 0.20 m."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:height, 0:width] + 0.5
    up = height - y
    rows, columns = int(height / 20) + 3, int(width / 18) + 3
    hue, tone = rng.random((rows, columns)), rng.normal(1.0, 0.09, (rows, columns))
    image = np.zeros((height, width, 3))
    depth = np.full((height, width), -1.0)
    # The tile that covers a point is of the upper course only where the lower edge of that course's tile reaches.
    for lift in (1, 0):
        course = (up // 20).astype(int) + lift
        along = x + (course % 2) * 9
        column = (along // 18).astype(int)
        offset = (along % 18 - 9) / 9
        lower = course * 20 - 5 + 6.5 * offset**2
        inside = (up >= lower) & (depth < 0)
        height_in = np.clip((up - lower) / 24, 0, 1)
        color = (
            ramp(hue[course, column], ("#74463a", "#8d5644", "#a1674d", "#7c5a4c", "#95604a"))
            * tone[course, column][..., None]
        )
        shade = (1.12 - 0.30 * height_in - 0.16 * np.abs(offset) ** 3)[..., None]
        shade = np.where((up - lower < 1.3)[..., None], 1.22, shade)
        image = np.where(inside[..., None], color * shade, image)
        depth = np.where(inside, 1.0, depth)
    moss = np.clip(noise((height, width), seed + 1, 1.5) - 0.7, 0, 1)
    image = mix(image, rgb("#6b6f43"), 0.55 * moss)
    return image * (1 + 0.05 * noise((height, width), seed + 2, 0.6)[..., None])


def glass(width: int, height: int) -> np.ndarray:
    """Dark glass with a pale sky in it and curtains behind."""
    y, x = np.mgrid[0:height, 0:width] / np.array([height, width])[:, None, None]
    image = ramp(np.clip(y * 0.9 + 0.12 * np.sin(6 * x + 3 * y), 0, 1), ("#7d93a0", "#4d6270", "#2b3942", "#232d33"))
    curtain = np.clip((np.abs(x - 0.5) - 0.30 - 0.06 * (1 - y)) * 16, 0, 1) * (0.75 + 0.25 * np.cos(x * 75))
    image = mix(image, rgb("#d8cdb8"), 0.62 * curtain)
    streak = np.clip(1 - np.abs(x + 0.55 * y - 0.75) * 14, 0, 1)
    return mix(image, rgb("#c7d4da"), 0.25 * streak)


def door(width: int, height: int) -> np.ndarray:
    """A green plank door with iron straps and a small window."""
    y, x = np.mgrid[0:height, 0:width]
    image = boards(height, width, 61, ("#2f4a3f", "#3d5d4e", "#4a6b5a")).transpose(1, 0, 2)
    image = image * (1 - 0.45 * np.clip(1.8 - np.abs(x % 20 - 10), 0, 1))[..., None]
    for level in (0.24, 0.80):
        strap = (np.abs(y - level * height) < 4) & (x < width * 0.82)
        image[strap] = rgb("#2b2a28")
    pane = (np.abs(x - width / 2) < 17) & (np.abs(y - height * 0.30 + 16) < 20)
    image[pane] = rgb("#8fa3a8")
    cross_bar = pane & ((np.abs(x - width / 2) < 2) | (np.abs(y - height * 0.30 + 16) < 2))
    image[cross_bar] = rgb("#2f4a3f")
    return image


def paint_atlas() -> np.ndarray:
    """The whole atlas, (2048, 1024, 3) uint8."""
    size = {name: (w, h) for name, (_, _, w, h) in REGIONS.items()}
    art: dict[str, np.ndarray] = {}
    for seed, name in enumerate(("front", "back", "cheek")):
        art[name] = bricks(*size[name], 100 + 10 * seed)
    art["side"] = gable(*size["side"], 300, 140)
    art["wing"] = gable(*size["wing"], 292, 150)
    for seed, name in enumerate(("front", "back", "cheek", "side", "wing")):
        art[name][-45:] = stones(size[name][0], 45, 200 + seed)
        art[name] = weather(art[name], 300 if name != "wing" else 292, 210 + seed)
    ivy(art["front"], [(20, 290, 34), (70, 210, 26), (462, 240, 16)], 5)
    ivy(art["side"], [(540, 330, 30), (30, 180, 22)], 6)
    ivy(art["back"], [(860, 280, 36), (300, 150, 20)], 7)
    ivy(art["wing"], [(330, 230, 16)], 8)
    art["roof"] = tiles(*size["roof"], 90)
    art["stack"], art["brick"] = bricks(*size["stack"], 160), bricks(*size["brick"], 165)
    art["glass"], art["door"] = glass(*size["glass"]), door(*size["door"])
    green = boards(*size["shutter"], 63, ("#3f6255", "#4c7263", "#587f6f"))
    slat = np.arange(size["shutter"][1])[:, None, None] % 11
    art["shutter"] = green * (1.08 - 0.035 * slat)
    art["cream"] = boards(*size["cream"], 65, ("#d3c8af", "#ded4bd", "#e6ddc8"))
    art["wood"] = boards(*size["wood"], 67, ("#5b4230", "#7a5b42", "#927254"))
    art["beam"] = boards(*size["beam"], 69, ("#3b2c21", "#54402f", "#6b533e"))
    art["stone"] = np.clip(rgb("#a59c8d") * (1 + 0.08 * noise(size["stone"][::-1], 71, 1.0)[..., None]), 0, 1)
    art["ridge"] = rgb("#8d5644") * (1 + 0.10 * noise(size["ridge"][::-1], 73, 1.0)[..., None])
    leafy = noise(size["leaves"][::-1], 75, 0.8)
    art["leaves"] = ramp(0.5 + 0.2 * leafy, ("#3c5526", "#57742f", "#7c9440"))
    spots = noise(size["flowers"][::-1], 77, 0.5)
    art["flowers"] = mix(
        ramp(0.5 + 0.2 * spots, ("#3c5a24", "#5f7d33")), rgb("#cf5a72"), np.clip(4 * spots - 0.4, 0, 1)
    )
    art["flowers"] = mix(art["flowers"], rgb("#ecd9d6"), np.clip(4 * noise(size["flowers"][::-1], 78, 0.5) - 5, 0, 1))
    art["brass"] = np.broadcast_to(rgb("#b08d4a"), (*size["brass"][::-1], 3))

    atlas = np.broadcast_to(rgb("#948d80"), (*ATLAS[::-1], 3)).copy()
    for name, (left, top, width, height) in REGIONS.items():
        atlas[top : top + height, left : left + width] = art[name]
    return to_bytes(atlas)
