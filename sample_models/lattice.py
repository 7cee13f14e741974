"""A hyperboloid lattice tower of straight struts."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
from shapes import Mesh, box, merge, revolve, tube
from writers import Glb

# Rings of the tower from the ground up: height and radius in metres, struts that start there in each direction.
RINGS = ((0.6, 5.4, 24), (8.6, 3.5, 24), (15.6, 2.3, 16), (21.2, 1.45, 12), (25.4, 0.9, 8))
RING_BAR, STRUT_BAR = 0.11, 0.085


def on_circle(radius: float, turn: np.ndarray | float, y: float) -> np.ndarray:
    """Points at azimuths (radians) on a level circle."""
    turn = np.asarray(turn, dtype=float)
    return np.stack([radius * np.sin(turn), np.full_like(turn, y), radius * np.cos(turn)], axis=-1)


def hoop(radius: float, y: float, bar: float, sides: int = 6, segments: int = 48) -> Mesh:
    """A level ring of round bar."""
    turn = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    profile = np.stack([radius + bar * np.cos(turn), y + bar * np.sin(turn)], axis=-1)
    return revolve(np.concatenate([profile, profile[:1]]), segments, angle_deg=70)


def tier(low: tuple[float, float, int], high: tuple[float, float, int], twist: float) -> Mesh:
    """The straight struts between two rings, leaning both ways, with the hoops that they cross."""
    parts = []
    for start in np.arange(low[2]) * (2 * np.pi / low[2]):
        for way in (-1, 1):
            foot = on_circle(low[1], start, low[0])
            head = on_circle(high[1], start + way * twist, high[0])
            parts.append(tube([foot, head], STRUT_BAR, sides=6))
    for t in (0.25, 0.5, 0.75):
        middle = (1 - t) * on_circle(low[1], 0.0, 0.0) + t * on_circle(high[1], twist, 0.0)
        parts.append(hoop(float(np.hypot(*middle[[0, 2]])), (1 - t) * low[0] + t * high[0], 0.05, sides=4))
    return merge(parts)


def gallery(radius: float, y: float) -> tuple[Mesh, Mesh]:
    """A round deck with a hole in the middle, and its railing."""
    deck = revolve(
        [
            (radius * 0.55, y),
            (radius + 0.55, y),
            (radius + 0.55, y + 0.12),
            (radius * 0.55, y + 0.12),
            (radius * 0.55, y),
        ],
        48,
    )
    turns = np.arange(24) * (2 * np.pi / 24)
    posts = [tube([on_circle(radius + 0.5, t, y + 0.1), on_circle(radius + 0.5, t, y + 1.15)], 0.03, 4) for t in turns]
    rails = [hoop(radius + 0.5, y + h, 0.035, 4) for h in (0.65, 1.15)]
    return deck, merge([*posts, *rails])


def stair(radius: float, low: float, high: float, turns: float) -> tuple[Mesh, Mesh]:
    """A spiral stair about a central pole: treads, and the pole with its handrail."""
    count = int((high - low) / 0.24)
    treads = []
    for k in range(count):
        t = k / count
        tread = box((radius, 0.05, 0.34)).moved(x=radius / 2).turned("y", np.degrees(2 * np.pi * turns * t))
        treads.append(tread.moved(y=low + (high - low) * t + 0.2))
    turn = np.linspace(0, 2 * np.pi * turns, 90) + np.pi / 2
    helix = np.stack([radius * np.sin(turn), np.linspace(low, high, 90) + 1.2, radius * np.cos(turn)], axis=-1)
    pole = revolve([(0.16, low), (0.16, high + 1.2)], 12)
    return merge(treads), merge([pole, tube(helix, 0.04, 5)])


def make_lattice(folder: Path) -> None:
    """Write lattice.glb."""
    glb = Glb("lattice")
    red = glb.add_material("red paint", "#a8402f", roughness=0.55)
    white = glb.add_material("white paint", "#d8d2c4", roughness=0.55)
    steel = glb.add_material("steel", "#5c6468", roughness=0.5)
    stone = glb.add_material("concrete", "#9a948a", roughness=1.0)
    lamp = glb.add_material("lamp", "#c9a227", roughness=0.3)

    tiers = [tier(a, b, np.radians(45 if k < 2 else 60)) for k, (a, b) in enumerate(pairwise(RINGS))]
    rings = merge([hoop(r, y, RING_BAR, 8) for y, r, _ in RINGS[1:]])
    decks, rails = zip(*(gallery(r, y) for y, r, _ in (RINGS[2], RINGS[4])), strict=True)
    treads, pole = stair(0.95, 0.6, RINGS[2][0] - 0.1, 5.5)
    plinth = revolve([(6.0, 0.0), (6.0, 0.42), (5.85, 0.55), (5.0, 0.6), (4.7, 0.6), (4.7, 0.0)], 64)
    pad = revolve([(1.3, 0.0), (1.3, 0.6), (0.0, 0.6)], 32)
    top = RINGS[-1][0]
    cabin = revolve([(0.75, top + 0.12), (0.75, top + 1.0), (0.82, top + 1.0), (0.82, top + 1.1)], 24)
    glass = revolve([(0.68, top + 1.1), (0.68, top + 1.9)], 24)
    roof = revolve(
        [(0.95, top + 1.9), (0.95, top + 2.0), (0.5, top + 2.4), (0.1, top + 2.6), (0.05, top + 5.6), (0.0, top + 5.7)],
        24,
    )

    root = glb.add_node("tower")
    base = [(merge([plinth, pad]), stone)]
    glb.add_node("base", glb.add_mesh("base", base), root)
    for k, shape in enumerate(tiers):
        glb.add_node(f"tier {k + 1}", glb.add_mesh(f"tier {k + 1}", [(shape, (red, white)[k % 2])]), root)
    glb.add_node("rings", glb.add_mesh("rings", [(rings, steel)]), root)
    glb.add_node("stair", glb.add_mesh("stair", [(treads, steel), (pole, steel)]), root)
    glb.add_node("galleries", glb.add_mesh("galleries", [(merge(decks), steel), (merge(rails), white)]), root)
    lantern = [(cabin, white), (glass, lamp), (roof, red)]
    glb.add_node("lantern", glb.add_mesh("lantern", lantern), root)
    glb.save(folder / "lattice.glb")
