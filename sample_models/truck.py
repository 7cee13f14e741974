"""A delivery truck of many nodes: instanced wheels and crates, and a right side that mirrors the left.

The truck drives toward +Z, so its left side is at +X.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from paint import noise, ramp, to_bytes
from shapes import Mesh, box, creased, extrude, grid, loft, merge, revolve, tube, unit
from writers import Glb

AXLES = (1.55, -1.50)
WHEEL = 0.41


def rounded(width: float, height: float, power: float, count: int) -> np.ndarray:
    """A superellipse, (count, 2), counter-clockwise; a higher power is squarer."""
    turn = np.linspace(0, 2 * np.pi, count, endpoint=False)
    c, s = np.cos(turn), np.sin(turn)
    shape = np.stack([np.sign(c) * np.abs(c) ** (2 / power), np.sign(s) * np.abs(s) ** (2 / power)], axis=-1)
    return shape * [width / 2, height / 2]


# The cab from the sill up: height, length, width, z of the middle, squareness of the plan.
CAB = np.array(
    [
        [0.60, 1.22, 1.46, 0.23, 5.5],
        [0.70, 1.28, 1.54, 0.23, 5.5],
        [1.00, 1.30, 1.60, 0.23, 5.5],
        [1.28, 1.28, 1.58, 0.23, 5.5],
        [1.34, 1.25, 1.54, 0.22, 5.5],
        [1.78, 1.07, 1.38, 0.15, 5.0],
        [1.88, 0.98, 1.28, 0.13, 4.5],
        [1.94, 0.80, 1.08, 0.12, 4.0],
        [1.965, 0.45, 0.70, 0.12, 3.0],
    ]
)


def on_cab(turn: np.ndarray, height: np.ndarray, lift: float = 0.0) -> np.ndarray:
    """Points of the cab's skin at plan angles (radians about +Y from +Z) and heights, lifted outward in metres."""
    length, width, middle, power = (np.interp(height, CAB[:, 0], CAB[:, k]) for k in range(1, 5))
    s, c = np.sin(turn), np.cos(turn)
    x = np.sign(s) * np.abs(s) ** (2 / power) * (width / 2 + lift)
    z = np.sign(c) * np.abs(c) ** (2 / power) * (length / 2 + lift) + middle
    return np.stack([x, np.broadcast_to(height, x.shape), z], axis=-1)


def plan_angle(x: float, z: float, height: float) -> float:
    """The plan angle at which the cab's skin lies in the direction of an (x, z) point on it."""
    turn = np.linspace(-np.pi, np.pi, 4001)
    points = on_cab(turn, np.full(4001, height))
    return float(turn[np.argmin(np.hypot(points[:, 0] - x, points[:, 2] - z))])


def on_skin(low: float, high: float, start: tuple[float, float], end: tuple[float, float], lift: float) -> Mesh:
    """A panel on the cab between two heights, and from one (x, z) place to another, with its edge turned in."""
    across = np.linspace(plan_angle(*start, (low + high) / 2), plan_angle(*end, (low + high) / 2), 17)
    up = np.linspace(low, high, 9)
    turn, height = np.meshgrid(across, up)
    face = on_cab(turn, height, lift)
    edge = on_cab(turn, height, -0.01)
    ringed = np.pad(face, ((1, 1), (1, 1), (0, 0)), mode="edge")
    rim = np.pad(edge, ((1, 1), (1, 1), (0, 0)), mode="edge")
    for border in (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1]):
        ringed[border] = rim[border]
    smooth = grid(ringed)
    return creased(smooth.positions, smooth.faces, angle_deg=35)


def cab_shell() -> Mesh:
    """The cab's body."""
    turn = np.linspace(0, 2 * np.pi, 72, endpoint=False)
    return loft([on_cab(turn, np.full(72, y)) for y in CAB[:, 0]], angle_deg=50)


def hood() -> Mesh:
    """The engine cover, tapering toward the nose."""
    sections = []
    for z, width, low, high, power in (
        (0.70, 1.16, 0.62, 1.36, 4.0),
        (1.10, 1.10, 0.60, 1.34, 3.6),
        (1.60, 1.00, 0.58, 1.30, 3.4),
        (2.00, 0.90, 0.56, 1.25, 3.3),
        (2.22, 0.80, 0.56, 1.18, 3.2),
        (2.30, 0.70, 0.60, 1.12, 3.2),
    ):
        ring = rounded(width, high - low, power, 48)
        sections.append(np.column_stack([ring[:, 0], ring[:, 1] + (low + high) / 2, np.full(48, z)]))
    return loft(sections, angle_deg=50)


def fender(axle: float, start_deg: float, end_deg: float, tail: float) -> Mesh:
    """A wheel arch at the left side; `tail` stretches its rear half backward."""
    angles = np.radians(np.linspace(start_deg, end_deg, 25))
    sections = []
    for k, angle in enumerate(angles):
        taper = 1 - 0.25 * (2 * k / (len(angles) - 1) - 1) ** 4
        ring = rounded(0.44 * taper, 0.15 * taper, 3.0, 16)
        radius = 0.555 + ring[:, 1] - 0.25 * (ring[:, 0] / 0.44) ** 2 * 0.35
        stretch = 1 + tail * max(0.0, -np.cos(angle)) ** 2
        z = axle + radius * np.cos(angle) * stretch
        sections.append(np.column_stack([0.78 - ring[:, 0], WHEEL + 0.02 + radius * np.sin(angle), z]))
    return loft(sections, angle_deg=60)


def wheel() -> tuple[Mesh, Mesh, Mesh]:
    """Tyre, disc and hub cap about the x axis, the outside toward +X."""
    tyre = [(0.24, -0.09), (0.30, -0.105), (0.375, -0.10), (0.402, -0.08), (WHEEL, -0.05), (WHEEL, 0.05), (0.402, 0.08)]
    tyre += [(0.375, 0.10), (0.30, 0.105), (0.24, 0.09), (0.24, -0.09)]
    disc = [(0.0, -0.06), (0.245, -0.06), (0.25, 0.085), (0.235, 0.085), (0.225, 0.05), (0.17, 0.035), (0.0, 0.05)]
    cap = [(0.125, 0.03), (0.12, 0.065), (0.10, 0.085), (0.05, 0.098), (0.0, 0.10)]
    return tuple(revolve(p, 32, 45).turned("z", -90) for p in (tyre, disc, cap))  # type: ignore[return-value]


def lamp(size: float) -> tuple[Mesh, Mesh]:
    """A round lamp that looks along +Z: pod and lens."""
    pod = [(0.0, -1.5), (0.45, -1.2), (0.8, -0.6), (0.97, 0.0), (1.0, 0.1), (0.88, 0.1), (0.86, 0.0)]
    lens = [(0.87, 0.02), (0.6, 0.18), (0.3, 0.25), (0.0, 0.27)]
    return tuple(revolve(np.array(p) * size, 24).turned("x", 90) for p in (pod, lens))  # type: ignore[return-value]


def planks(count: int, width: float, length: float, thick: float, gap: float = 0.012) -> Mesh:
    """Boards side by side along x, each as long as `length` along z; every one shows another part of the grain."""
    pitch = width / count
    boards = []
    for k in range(count):
        board = box((pitch - gap, thick, length), 0.006)
        uvs = board.positions[:, [0, 2]] / [0.5, 2.0] + [0.31 * k, 0.17 * k]
        boards.append(replace(board, uvs=uvs).moved(x=(k + 0.5) * pitch - width / 2))
    return merge(boards)


def crate() -> Mesh:
    """A slatted wooden box of 0.52 m standing on the origin."""
    size = 0.52
    side = merge([planks(4, size, size - 0.04, 0.02).moved(y=size / 2 - 0.012)])
    faces = [side, side.turned("x", 90), side.turned("x", -90), side.turned("z", 90), side.turned("z", -90)]
    edge = box((0.05, size + 0.02, 0.05), 0.006)
    edges = [edge.moved(x=sx * size / 2, z=sz * size / 2) for sx in (-1, 1) for sz in (-1, 1)]
    bars = [
        box((0.05, 0.05, size), 0.006).moved(x=sx * size / 2, y=sy * (size - 0.03) / 2)
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    rest = [bar.turned("y", 90) for bar in bars]
    return merge([*faces, *edges, *bars, *rest]).moved(y=size / 2 + 0.01)


def barrel() -> tuple[Mesh, Mesh]:
    """Staves and hoops of a barrel standing on the origin."""
    y = np.linspace(0, 0.78, 9)
    radius = 0.24 + 0.055 * (1 - (2 * y / 0.78 - 1) ** 2)
    body = revolve(
        [(0.0, 0.03), (0.22, 0.03), (0.22, 0.0), *zip(radius, y, strict=True), (0.22, 0.78), (0.22, 0.75), (0.0, 0.75)],
        28,
    )
    hoops = []
    for low in (0.07, 0.25, 0.48, 0.66):
        ring = np.interp([low, low + 0.05], y, radius) + 0.006
        hoops.append(
            revolve([(ring[0] - 0.03, low), (ring[0], low), (ring[1], low + 0.05), (ring[1] - 0.03, low + 0.05)], 28)
        )
    x, height, z = body.positions.T
    lid = np.abs(body.normals[:, 1:2]) > 0.7
    uvs = np.where(lid, np.stack([2 * x, 0.5 * z], axis=-1), np.stack([0.6 * np.arctan2(x, z), 0.5 * height], axis=-1))
    return replace(body, uvs=uvs), merge(hoops)


def wood_texture() -> np.ndarray:
    """Straight-grained boards, (256, 256, 3) uint8, that tile; the grain runs up."""
    grain = noise((256, 256), 8, 1.3, (1.0, 0.06)) * 0.16 + noise((256, 256), 9, 1.8) * 0.10
    return to_bytes(ramp(0.5 + grain, ("#6b4a2e", "#a07a50", "#c9a577")))


def bed(glb: Glb, parent: int, wood: int, steel: int) -> None:
    """The flat bed with its stake sides, and the cargo on it."""
    floor = planks(8, 1.84, 2.1, 0.05)
    frame = merge([box((1.88, 0.1, 0.06), 0.01).moved(y=-0.06, z=z) for z in (-1.02, -0.35, 0.35, 1.02)])
    node = glb.add_node("bed", glb.add_mesh("bed", [(floor, wood), (frame, steel)]), parent, at=(0, 0.98, -1.52))
    boards = planks(3, 0.50, 2.06, 0.03, 0.05).turned("z", 90).moved(y=0.33)
    stakes = merge([box((0.05, 0.66, 0.07), 0.008).moved(x=-0.035, y=0.27, z=z) for z in (-0.95, -0.32, 0.32, 0.95)])
    rack = glb.add_mesh("rack", [(boards, wood), (stakes, steel)])
    glb.add_node("left rack", rack, node, at=(0.90, 0, 0))
    glb.add_node("right rack", rack, node, at=(-0.90, 0, 0), turn=("y", 180))
    end = glb.add_mesh("end rack", [(planks(3, 0.50, 1.74, 0.03, 0.05).turned("z", 90).moved(y=0.33), wood)])
    glb.add_node("headboard", end, node, at=(0, 0, 1.0), turn=("y", 90))
    glb.add_node("tailgate", end, node, at=(0, 0, -1.02), turn=("y", 90))

    cargo = glb.add_node("cargo", parent=node, at=(0, 0.025, 0))
    crates = glb.add_mesh("crate", [(crate(), wood)])
    for k, (x, y, z, turn) in enumerate(
        ((0.5, 0, 0.62, 4), (-0.12, 0, 0.66, -6), (0.46, 0, -0.02, -3), (0.28, 0.55, 0.55, 21))
    ):
        glb.add_node(f"crate {k + 1}", crates, cargo, at=(x, y, z), turn=("y", turn))
    staves, hoops = barrel()
    barrels = glb.add_mesh("barrel", [(staves, wood), (hoops, steel)])
    for k, (x, z) in enumerate(((-0.52, -0.02), (-0.5, -0.66), (0.12, -0.68))):
        glb.add_node(f"barrel {k + 1}", barrels, cargo, at=(x, 0, z), turn=("y", 70 * k))


def left_side(
    glb: Glb, paint: int, trim: int, chrome: int, glass: int, black: int
) -> dict[str, tuple[int, tuple[float, float, float]]]:
    """The meshes that both sides share: name -> (mesh, place) on the left side."""
    door = on_skin(0.72, 1.30, (0.79, 0.66), (0.79, -0.27), 0.012)
    window = on_skin(1.40, 1.76, (0.72, 0.50), (0.72, -0.18), 0.012)
    surround = on_skin(1.365, 1.79, (0.72, 0.55), (0.72, -0.23), 0.006)
    handle = tube([(0.80, 1.14, -0.16), (0.845, 1.15, -0.15), (0.845, 1.15, -0.03), (0.80, 1.14, -0.02)], 0.014, 8)
    stripe = on_skin(1.02, 1.06, (0.79, 0.64), (0.79, -0.25), 0.020)
    step = merge([box((0.34, 0.05, 1.45), 0.02).moved(0.82, 0.50, 0.17)])
    treads = merge([box((0.025, 0.012, 1.30), 0.004).moved(0.72 + 0.05 * k, 0.53, 0.17) for k in range(5)])
    arm = tube([(0.76, 1.36, 0.56), (0.93, 1.42, 0.62), (0.96, 1.50, 0.62)], 0.013, 8)
    glass_disc = (
        revolve([(0.0, -0.02), (0.08, -0.015), (0.10, 0.01), (0.0, 0.012)], 20).turned("x", -90).moved(0.96, 1.58, 0.62)
    )
    pod, lens = lamp(0.135)
    return {
        "door": (glb.add_mesh("door", [(door, paint), (stripe, trim), (handle, chrome)]), (0, 0, 0)),
        "window": (glb.add_mesh("window", [(surround, black), (window, glass)]), (0, 0, 0)),
        "running board": (glb.add_mesh("running board", [(step, paint), (treads, black)]), (0, 0, 0)),
        "mirror": (glb.add_mesh("mirror", [(merge([arm, glass_disc]), chrome)]), (0, 0, 0)),
        "front fender": (glb.add_mesh("front fender", [(fender(AXLES[0], 8, 196, 0.30), paint)]), (0, 0, 0)),
        "rear fender": (glb.add_mesh("rear fender", [(fender(AXLES[1], -8, 190, 0.0), paint)]), (0, 0, 0)),
        "head lamp": (glb.add_mesh("head lamp", [(pod, chrome), (lens, trim)]), (0.66, 1.04, 2.06)),
    }


def make_truck(folder: Path) -> None:
    """Write truck.glb."""
    glb = Glb("truck")
    paint = glb.add_material("teal paint", "#2f6f73", roughness=0.35)
    trim = glb.add_material("cream paint", "#e2d3b0", roughness=0.4)
    chrome = glb.add_material("chrome", "#b9bdc0", roughness=0.25)
    glass = glb.add_material("glass", "#26343d", roughness=0.1)
    rubber = glb.add_material("rubber", "#2a2a2b", roughness=0.95)
    steel = glb.add_material("dark steel", "#3c4144", roughness=0.6)
    amber = glb.add_material("tail lamp", "#a3301f", roughness=0.3)
    wood = glb.add_material("wood", texture=glb.add_texture(wood_texture(), 88), roughness=0.9)

    truck = glb.add_node("truck")
    rails = [box((0.10, 0.16, 4.7), 0.02).moved(x, 0.60, -0.25) for x in (-0.40, 0.40)]
    horns = [box((0.07, 0.07, 0.50), 0.015).moved(x, 0.54, 2.30) for x in (-0.40, 0.40)]
    apron = box((0.98, 0.10, 0.40), 0.04).moved(0, 0.58, 2.20)
    rails = merge([*rails, *horns, apron])
    tank = revolve([(0.0, -0.42), (0.16, -0.42), (0.17, -0.4), (0.17, 0.4), (0.16, 0.42), (0.0, 0.42)], 24).turned(
        "x", 90
    )
    chassis = glb.add_node(
        "chassis", glb.add_mesh("chassis", [(rails, steel), (tank.moved(0.62, 0.62, -0.62), steel)]), truck
    )

    tyre, disc, cap = wheel()
    wheels = glb.add_mesh("wheel", [(tyre, rubber), (disc, trim), (cap, chrome)])
    axle_bar = glb.add_mesh("axle", [(tube([(-0.75, 0, 0), (0.75, 0, 0)], 0.06, 12), steel)])
    for name, z in zip(("front", "rear"), AXLES, strict=True):
        axle = glb.add_node(f"{name} axle", axle_bar, chassis, at=(0, WHEEL, z))
        glb.add_node(f"{name} left wheel", wheels, axle, at=(0.80, 0, 0), turn=("x", 20))
        glb.add_node(f"{name} right wheel", wheels, axle, at=(-0.80, 0, 0), turn=("y", 180))
    glb.add_node("spare wheel", wheels, chassis, at=(0.0, 0.68, -2.14), turn=("z", -90), scale=(0.9, 0.9, 0.9))

    windscreen = on_skin(1.41, 1.75, (-0.60, 0.80), (0.60, 0.80), 0.012)
    seal = on_skin(1.375, 1.785, (-0.645, 0.78), (0.645, 0.78), 0.006)
    rear = on_skin(1.44, 1.72, (0.42, -0.40), (-0.42, -0.40), 0.012)
    body = glb.add_node(
        "cab", glb.add_mesh("cab", [(cab_shell(), paint), (seal, rubber), (windscreen, glass), (rear, glass)]), truck
    )
    glb.add_node("hood", glb.add_mesh("hood", [(hood(), paint)]), body)
    bars = merge([box((0.62 - 0.018 * k, 0.026, 0.05), 0.01).moved(0, 0.68 + 0.055 * k, 2.305) for k in range(8)])
    plate = box((0.62, 0.46, 0.03), 0.012).moved(0, 0.87, 2.292)
    glb.add_node("grille", glb.add_mesh("grille", [(plate, steel), (bars, chrome)]), body)
    bend = np.linspace(-1, 1, 21)
    bumper = np.stack([1.0 * bend, np.full(21, 0.52), 2.56 - 0.16 * np.abs(bend) ** 3], axis=-1)
    ring = rounded(0.15, 0.05, 3.0, 16)
    forward = unit(np.stack([0.48 * np.sign(bend) * bend**2, np.zeros(21), np.ones(21)], axis=-1))
    skin = bumper[:, None] + ring[:, :1] * np.array([0, 1.0, 0]) + ring[:, 1:] * forward[:, None]
    glb.add_node("bumper", glb.add_mesh("bumper", [(loft(skin), chrome)]), chassis)
    ornament = extrude([(-0.16, 0.0), (0.10, 0.0), (0.02, 0.035), (-0.16, 0.05)], 0.03, 0.008).turned("y", -90)
    glb.add_node("hood ornament", glb.add_mesh("hood ornament", [(ornament, chrome)]), body, at=(0, 1.26, 1.95))

    shared = left_side(glb, paint, trim, chrome, glass, rubber)
    left = glb.add_node("left side", parent=truck)
    right = glb.add_node("right side", parent=truck, scale=(-1, 1, 1))
    tail = glb.add_mesh("tail lamp", [(box((0.10, 0.14, 0.06), 0.02), amber)])
    for side, group in (("left", left), ("right", right)):
        for name, (mesh, place) in shared.items():
            glb.add_node(f"{side} {name}", mesh, group, at=place)
        glb.add_node(f"{side} tail lamp", tail, group, at=(0.75, 0.88, -2.58))
    bed(glb, truck, wood, steel)
    glb.save(folder / "truck.glb")
