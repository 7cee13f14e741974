"""A study, 4 metres wide, 3 high and 6 long, as light that arrives at its middle.

Every direction is followed to the wall that it meets, so that the map lines up with a room of that size: in front (-Z)
a door, to the right (+X) a window onto the meadow, to the left a painting, behind a bookcase.
"""

from __future__ import annotations

import meadow
import numpy as np
from meadow import linear, mix, tiled
from paint import noise

HALF = np.array([2.0, 1.5, 3.0])
OUTDOORS = 3.0  # how much brighter the meadow is than as itself: a room is dim
WINDOW = (-1.25, 1.25, -0.45, 1.05)  # from and to along z, from and to along y
DOOR = (0.35, 1.3, -1.5, 0.62)  # along x and y
PAINTING = (-1.0, 0.9, -0.2, 0.95)  # along z, mirrored, and y
BOOKCASE = (-1.5, 1.5, -1.5, 0.9)
LAMPS = ((0.0, 1.5), (0.0, -1.5))
LAMP_SIZE, LAMP_LIGHT = (1.2, 0.5), np.array([7.0, 6.3, 5.2])
WINDOW_LIGHT = np.array([2.2, 2.7, 3.2])
AMBIENT = np.array([0.34, 0.31, 0.27])
GRAIN, SPOTS = noise((512, 512), 31, 1.0, (1.0, 0.15)), noise((512, 512), 32, 1.2)
WHITE, CREAM, GREEN = linear("#e9e4d8"), linear("#d9c7a0"), linear("#7f9478")
WOOD, DARK_WOOD, BRASS = linear("#8a5a33"), linear("#4b2d1a"), linear("#d8b25a")
SPINES = [linear(c) for c in ("#7b2d26", "#2f4a63", "#c9b27c", "#3f5a3c", "#5b3a5f", "#a8552f", "#d8cfb8", "#273238")]


def radiance(directions: np.ndarray) -> np.ndarray:
    """Linear radiance from directions (H, W, 3) at the middle of the room."""
    reach = HALF / np.maximum(np.abs(directions), 1e-9)
    axis = reach.argmin(axis=-1)
    place = directions * reach.min(axis=-1)[..., None]
    ahead = np.take_along_axis(directions, axis[..., None], -1)[..., 0] > 0
    light = np.zeros_like(directions)
    for wall, (number, positive) in zip(
        (_left, _window_wall, _floor, _ceiling, _door_wall, _bookcase_wall),
        ((0, False), (0, True), (1, False), (1, True), (2, False), (2, True)),
        strict=True,
    ):
        here = (axis == number) & (ahead == positive)
        points = place[here]
        if not len(points):
            continue
        normal = np.zeros(3)
        normal[number] = -1 if positive else 1
        albedo, shine = wall(points, directions[here])
        light[here] = albedo * _lit(points, normal) + shine
    return light


def _lit(points: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """What a white wall shows at some points: window, lamps, sun, and the rest of the room."""
    gaps = np.sort(np.abs(HALF - np.abs(points)), axis=-1)[:, 1:]
    light = AMBIENT * np.prod(1 - 0.4 * np.exp(-gaps / 0.3), axis=-1, keepdims=True)
    z0, z1, y0, y1 = WINDOW
    window = _area(np.array([2.0, (y0 + y1) / 2, (z0 + z1) / 2]), (0, y1 - y0, z1 - z0), (-1, 0, 0), (1, 4, 6))
    light = light + _from_area(points, normal, *window) * WINDOW_LIGHT
    for x, z in LAMPS:
        lamp = _area(np.array([x, 1.49, z]), (LAMP_SIZE[0], 0, LAMP_SIZE[1]), (0, -1, 0), (6, 1, 3))
        light = light + _from_area(points, normal, *lamp) * LAMP_LIGHT
    back = (2 - points[:, :1]) / meadow.SUN[0]
    through = points + back * meadow.SUN
    shines = _pane(through[:, 2], through[:, 1]) * max(float(normal @ meadow.SUN), 0)
    return light + shines[:, None] * OUTDOORS * meadow.SUN_IRRADIANCE * meadow.SUN_COLOR


def _area(middle: np.ndarray, size: tuple, facing: tuple, counts: tuple) -> tuple[np.ndarray, np.ndarray, float]:
    """A rectangle of light as points, its normal, and the area that each point stands for."""
    steps = [(np.arange(count) + 0.5) / count - 0.5 for count in counts]
    offsets = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3) * size
    area = np.prod([side for side in size if side]) / len(offsets)
    return middle + offsets, np.array(facing, float), float(area)


def _from_area(
    points: np.ndarray, normal: np.ndarray, lights: np.ndarray, facing: np.ndarray, area: float
) -> np.ndarray:
    """Irradiance / pi from a rectangle of unit radiance, (K, 1)."""
    total = np.zeros((len(points), 1))
    for light in lights:
        way = light - points
        square = np.maximum((way**2).sum(axis=-1, keepdims=True), 0.02)
        total += np.maximum(way @ normal, 0)[:, None] * np.maximum(-way @ facing, 0)[:, None] * area / square**2
    return total / np.pi


def _pane(along: np.ndarray, up: np.ndarray) -> np.ndarray:
    """1 where the window is glass, 0 on its bars and beyond it."""
    z0, z1, y0, y1 = WINDOW
    column = np.abs((along - z0) / (z1 - z0) * 3 % 1 - 0.5) * (z1 - z0) / 3
    row = np.abs((up - y0) / (y1 - y0) * 2 % 1 - 0.5) * (y1 - y0) / 2
    glass = (column < (z1 - z0) / 6 - 0.03) & (row < (y1 - y0) / 4 - 0.03)
    return (glass & (along > z0) & (along < z1) & (up > y0) & (up < y1)).astype(float)


def _inside(u: np.ndarray, v: np.ndarray, box: tuple, grown: float = 0.0) -> np.ndarray:
    """How far inside a rectangle grown by some metres: positive within."""
    u0, u1, v0, v1 = box
    return np.minimum.reduce([u - u0, u1 - u, v - v0, v1 - v]) + grown


def _papered(across: np.ndarray, up: np.ndarray) -> np.ndarray:
    """A wall: skirting, panels to the waist, a rail, paper with thin stripes above."""
    paper = mix(GREEN, GREEN * 1.12, 0.5 + 0.5 * np.sign(np.sin(across * 2 * np.pi / 0.24)))
    paper = paper * (1 + 0.03 * tiled(SPOTS, across / 2, up / 2))[:, None]
    panel = _inside((across + 100) % 0.75, up, (0.1, 0.65, -1.28, -0.72))
    rim = np.clip(1 - np.abs(panel) / 0.02, 0, 1)
    below = WHITE * (1 - 0.3 * rim * (1 + 0.5 * np.sign(up + 1.0)) / 1.5)[:, None]
    wall = np.where((up < -0.6)[:, None], below, paper)
    rail = np.abs(up + 0.6) < 0.035
    wall = np.where(rail[:, None], WHITE * np.clip(0.75 + 8 * (up + 0.6), 0.5, 1.05)[:, None], wall)
    skirting = WHITE * np.where(np.abs(up + 1.36) < 0.008, 0.55, 0.95)[:, None]
    wall = np.where((up < -1.36)[:, None], skirting, wall)
    return np.where((up > 1.38)[:, None], WHITE * np.where(up > 1.395, 1.0, 0.6)[:, None], wall)


def _left(points: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The painting, of the sea with a boat, in a gilt frame; its right is toward -Z."""
    across, up = -points[:, 2], points[:, 1]
    wall = _papered(across, up)
    within = _inside(across, up, PAINTING)
    drop = np.clip(_inside(across - 0.03, up + 0.05, PAINTING, 0.12) / 0.08, 0, 1)
    wall = wall * (1 - 0.45 * drop)[:, None]
    frame = mix(BRASS * 0.55, BRASS, np.abs(np.sin((within + 0.12) * np.pi / 0.06)))
    wall = np.where((within > -0.12)[:, None], frame, wall)
    a0, a1, b0, b1 = PAINTING
    u, v = (across - a0) / (a1 - a0), (up - b0) / (b1 - b0)
    paint = mix(linear("#f1c27a"), linear("#4f7fb0"), (v - 0.4) * 1.8)
    sun = np.hypot(u - 0.24, (v - 0.56) * 0.6)
    paint = mix(paint, linear("#fff0c0"), np.clip(1.2 - sun / 0.06, 0, 1))
    hill = 0.4 + 0.16 * np.clip(1 - np.abs(u - 0.86) / 0.3, 0, 1) + 0.02 * np.sin(u * 40)
    paint = mix(paint, linear("#5b5878"), np.clip((hill - v) * 60, 0, 1))
    waves = 0.5 + 0.5 * tiled(GRAIN.T, u * 0.5, v)
    glitter = np.clip(1 - np.abs(u - 0.24) / (0.05 + 0.3 * (0.4 - v)), 0, 1) * waves
    sea = mix(linear("#2b5a6b") * (0.8 + 0.3 * waves)[:, None], linear("#ffd9a0"), 0.8 * glitter)
    paint = np.where((v < 0.4)[:, None], sea, paint)
    hull = (np.abs(u - 0.56) < 0.11 - 0.6 * np.maximum(0.3 - v, 0)) & (v > 0.24) & (v < 0.3)
    sail = (u > 0.565) & (v > 0.32) & (u - 0.565 < (0.78 - v) * 0.26)
    jib = (u < 0.555) & (v > 0.32) & (0.555 - u < (0.7 - v) * 0.2)
    paint = np.where(hull[:, None], linear("#6b2f22"), paint)
    paint = np.where((sail | jib)[:, None], linear("#f4ead2") * np.where(jib, 0.85, 1)[:, None], paint)
    return np.where((within > 0)[:, None], paint, wall), np.zeros(3)


def _window_wall(points: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The window with its bars, sill and curtains; its right is toward +Z."""
    across, up = points[:, 2], points[:, 1]
    wall = _papered(across, up)
    within = _inside(across, up, WINDOW)
    frame = WHITE * np.where(np.abs(within + 0.05) < 0.01, 0.7, 1.0)[:, None]
    wall = np.where((within > -0.1)[:, None], frame, wall)
    sill = _inside(across, up, (WINDOW[0] - 0.2, WINDOW[1] + 0.2, WINDOW[2] - 0.16, WINDOW[2] - 0.08))
    wall = np.where((sill > 0)[:, None], WHITE, wall)
    aside = np.abs(across)
    hem = 0.012 * np.sin(across * 40)
    curtain = (aside > 1.28) & (aside < 1.72) & (up < 1.24) & (up > -1.3 + hem)
    folds = 0.62 + 0.38 * np.sin(aside * 62 + 1.5 * np.sin(up * 1.3))
    wall = np.where(curtain[:, None], linear("#9a3b2e") * folds[:, None], wall)
    rod = (np.abs(up - 1.26) < 0.022) & (aside < 1.85)
    wall = np.where(rod[:, None], BRASS * np.clip(0.7 + 16 * (up - 1.26), 0.3, 1.1)[:, None], wall)
    glass = _pane(across, up)[:, None]
    outdoors = np.zeros_like(directions)
    seen = glass[:, 0] > 0
    if seen.any():
        outdoors[seen] = meadow.radiance(directions[None, seen])[0]
    return wall * (1 - glass), outdoors * OUTDOORS * glass


def _floor(points: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tiles of half a metre, light and dark."""
    x, z = points[:, 0] + 2, points[:, 2] + 3
    dark = (np.floor(x * 2) + np.floor(z * 2)) % 2
    veins = np.exp(-np.abs(tiled(SPOTS, x / 3 + dark * 0.4, z / 3)) * 9)
    tile = mix(linear("#d8cbb2"), linear("#4a5358"), dark) * (1 - 0.18 * veins + 0.2 * veins * dark)[:, None]
    joint = np.maximum(np.abs(x * 2 % 1 - 0.5), np.abs(z * 2 % 1 - 0.5)) > 0.488
    return np.where(joint[:, None], linear("#6f6a60"), tile), np.zeros(3)


def _ceiling(points: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """White panels of a metre with bevelled rims, and two that shine."""
    x, z = points[:, 0], points[:, 2]
    rim = 0.5 - np.maximum(np.abs((x + 2) % 1 - 0.5), np.abs((z + 3) % 1 - 0.5))
    panel = WHITE * np.where(rim < 0.05, 0.72 + 4 * rim, np.where(rim < 0.07, 0.8, 1.0))[:, None]
    shine = np.zeros_like(points)
    for at_x, at_z in LAMPS:
        within = np.minimum(LAMP_SIZE[0] / 2 - np.abs(x - at_x), LAMP_SIZE[1] / 2 - np.abs(z - at_z))
        panel = np.where((within > -0.05)[:, None], BRASS * 0.5, panel)
        bars = np.abs((x - at_x) / 0.3 % 1 - 0.5) > 0.46
        shine += ((within > 0) & ~bars)[:, None] * LAMP_LIGHT
    return panel, shine


def _door_wall(points: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A panelled door right of the middle, its handle at the left, and a clock; its right is toward +X."""
    across, up = points[:, 0], points[:, 1]
    wall = _papered(across, up)
    within = _inside(across, up, DOOR)
    frame = WHITE * np.where(np.abs(within + 0.06) < 0.012, 0.65, 1.0)[:, None]
    wall = np.where((within > -0.12)[:, None], frame, wall)
    grain = (1 + 0.12 * tiled(GRAIN, up / 2.2, across))[:, None]
    door = WOOD * grain
    u, v = (across - DOOR[0]) / (DOOR[1] - DOOR[0]), (up - DOOR[2]) / (DOOR[3] - DOOR[2])
    for low, high in ((0.07, 0.36), (0.43, 0.62), (0.69, 0.94)):
        for left, right in ((0.12, 0.46), (0.54, 0.88)):
            inner = np.minimum(np.minimum(u - left, right - u) * 0.95, np.minimum(v - low, high - v) * 2.12)
            edge = np.clip(1 - np.abs(inner - 0.012) / 0.02, 0, 1)
            darker = np.where((v - low < high - v) == (inner > 0.012), 1.35, 0.5)
            door = door * (1 + (darker - 1) * edge * (inner > -0.01))[:, None]
    door = np.where((within < 0.012)[:, None], DARK_WOOD * 0.5, door)
    plate = _inside(u, v, (0.055, 0.095, 0.38, 0.5))
    knob = np.hypot((u - 0.075) * 0.95, (v - 0.46) * 2.12)
    door = np.where((plate > 0)[:, None], BRASS * 0.8, door)
    door = np.where((knob < 0.035)[:, None], BRASS * np.clip(1.4 - knob / 0.035, 0.4, 1.2)[:, None], door)
    wall = np.where((within > 0)[:, None], door, wall)
    return _clock(wall, across + 0.85, up - 0.55), np.zeros(3)


def _clock(wall: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Ten past ten, which a mirror would show as ten to two."""
    away, turn = np.hypot(x, y), np.degrees(np.arctan2(x, y)) % 360
    wall = wall * (1 - 0.4 * np.clip((0.4 - np.hypot(x - 0.03, y + 0.05)) / 0.06, 0, 1))[:, None]
    wall = np.where((away < 0.34)[:, None], DARK_WOOD * np.clip(1.2 - 3 * np.abs(away - 0.31), 0.5, 1.3)[:, None], wall)
    wall = np.where((away < 0.29)[:, None], linear("#f2eddc"), wall)
    tick = np.abs((turn + 15) % 30 - 15) * np.radians(1) * away < np.where((turn + 45) % 90 < 60, 0.006, 0.012)
    wall = np.where((tick & (away > 0.23) & (away < 0.275))[:, None], DARK_WOOD * 0.3, wall)
    for angle, length, width in ((305, 0.15, 0.012), (60, 0.22, 0.008)):
        way = np.array([np.sin(np.radians(angle)), np.cos(np.radians(angle))])
        along, beside = x * way[0] + y * way[1], np.abs(x * way[1] - y * way[0])
        hand = (along > -0.03) & (along < length) & (beside < width)
        wall = np.where(hand[:, None], DARK_WOOD * 0.15, wall)
    return wall


def _bookcase_wall(points: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A bookcase of six shelves; the wall's right is toward -X."""
    across, up = -points[:, 0], points[:, 1]
    wall = _papered(across, up)
    within = _inside(across, up, BOOKCASE)
    height, board = (BOOKCASE[3] - BOOKCASE[2]) / 6, 0.035
    level = (up - BOOKCASE[2]) / height
    shelf, above = np.clip(np.floor(level).astype(int), 0, 5), (level % 1) * height - board
    random = np.random.default_rng(5)
    case = np.zeros_like(points) + DARK_WOOD * 0.25
    for number in range(6):
        left = BOOKCASE[0] + board
        while left < BOOKCASE[1] - board - 0.07:
            width, tall, color = random.uniform(0.03, 0.075), random.uniform(0.23, 0.34), SPINES[random.integers(8)]
            gap = random.uniform(0.1, 0.3) if random.random() < 0.06 else 0.0
            u = (across - left) / width
            book = (shelf == number) & (u > 0.02) & (u < 0.98) & (above > 0) & (above < tall)
            round_ = 0.55 + 0.6 * np.sqrt(np.clip(1 - (2 * u - 1) ** 2, 0, 1))
            band = np.abs(above / tall - 0.78) < 0.035
            spine = np.where(band[:, None], BRASS * 0.8, color) * round_[:, None]
            case = np.where(book[:, None], spine, case)
            left += width + gap
    deep = np.clip(1 - (height - board - above) / 0.1, 0, 1)  # the shelf above casts its shadow
    case = case * (1 - 0.6 * deep)[:, None]
    boards = (above < 0) | (np.abs(across) > BOOKCASE[1] - board) | (up > BOOKCASE[3] - board)
    wood = DARK_WOOD * 1.3 * (1 + 0.15 * tiled(GRAIN, across / 3, up))[:, None]
    case = np.where(boards[:, None], wood, case)
    return np.where((within > 0)[:, None], case, wall), np.zeros(3)
