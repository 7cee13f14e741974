"""A robed marble figure on a drum: signed distances, blended and polygonised.

The figure is modelled in metres with its feet at y = 0, facing +Z; its left side is at +X.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
from sculpture import Sculpture, capsule, draped, ellipsoid, pleat, soft_max, soft_min
from shapes import Mesh, merge, revolve, rotation, tube, unit
from writers import Glb

DRUM = 0.46

SKIRT = (
    (-0.05, 0.265, 0.245),
    (0.04, 0.255, 0.235),
    (0.25, 0.225, 0.20),
    (0.55, 0.20, 0.175),
    (0.80, 0.195, 0.165),
    (0.92, 0.19, 0.155),
    (1.05, 0.128, 0.105),
    (1.2, 0.12, 0.10),
)
BODICE = (
    (0.70, 0.232, 0.200),
    (0.86, 0.222, 0.188),
    (0.95, 0.200, 0.165),
    (1.07, 0.130, 0.108),
    (1.15, 0.143, 0.118),
    (1.25, 0.164, 0.126),
    (1.34, 0.178, 0.112),
    (1.40, 0.165, 0.088),
    (1.46, 0.105, 0.068),
    (1.5, 0.06, 0.055),
)


def robe(s: Sculpture) -> None:
    """The long skirt with a bent knee under it, the bodice with its overfold, the girdle."""
    where, p = s.part((-0.5, -0.05, -0.5), (0.5, 1.2, 0.5))
    x, y, z = np.moveaxis(p, -1, 0)
    d, turn = draped(p, SKIRT)
    d = soft_min(d, capsule(p, (0.10, 0.90, 0.05), (0.105, 0.50, 0.165), 0.095, 0.072), 0.10)
    d = soft_min(d, capsule(p, (0.105, 0.50, 0.165), (0.125, 0.06, 0.06), 0.072, 0.08), 0.10)
    knee = np.exp(-(((x - 0.10) / 0.10) ** 2 + ((y - 0.52) / 0.22) ** 2)) * (z > 0)
    warped = turn + 0.10 * np.sin(2 * turn + 0.8) + 0.05 * np.sin(3 * turn - 4.0 * y) + 0.035 * np.sin(7 * turn + 9 * y)
    depth = (0.012 + 0.034 * np.clip(1 - y / 0.95, 0, 1) ** 0.8) * (1 - 0.85 * knee) * (1 + 0.35 * np.sin(3 * turn + 1))
    d = d - depth * pleat(9.5 * warped) - 0.22 * depth * pleat(23 * warped + 3 * y)
    s.field[where] = soft_min(s.field[where], soft_max(d, y - 1.1, 0.02), 0.01)

    where, p = s.part((-0.5, 0.65, -0.5), (0.5, 1.52, 0.5))
    x, y, z = np.moveaxis(p, -1, 0)
    d, turn = draped(p, BODICE)
    for side in (-1, 1):
        d = soft_min(d, ellipsoid(p, (side * 0.074, 1.245, 0.082), (0.066, 0.066, 0.064)), 0.05)
        d = soft_min(d, capsule(p, (side * 0.04, 1.425, -0.01), (side * 0.175, 1.395, -0.005), 0.05, 0.052), 0.06)
    warped = turn + 0.08 * np.sin(3 * turn + 1.5) + 0.03 * np.sin(5 * turn + 12 * y)
    below = np.clip((1.08 - y) / 0.10, 0, 1)
    front = np.exp(-((x / 0.13) ** 2)) * (z > 0) * np.clip((y - 1.24) / 0.08, 0, 1)
    d = d - (0.007 + 0.017 * below) * (1 - front) * (np.abs(y - 1.08) > -1) * pleat(11 * warped + 0.5)
    bare = 1.372 + 0.55 * np.sqrt(x * x + 0.0004) + 0.055 * np.clip((0.02 - z) / 0.06, 0, 1)
    sag = y - 1.1 * np.sqrt(x * x + 0.0012)
    d = d - 0.010 * front * pleat(np.pi * sag / 0.042)
    hem = (
        0.855
        + 0.035 * np.sin(2 * turn + 0.6)
        + 0.016 * pleat(11 * warped + 0.5)
        + 0.05 * np.clip(np.abs(turn) / np.pi - 0.5, 0, 1)
    )
    d = soft_max(soft_max(d, hem - y, 0.012), y - bare, 0.014)
    s.field[where] = np.minimum(s.field[where], d)

    where, p = s.part((-0.25, 1.0, -0.25), (0.25, 1.15, 0.25))
    d, turn = draped(p, BODICE)
    y = p[..., 1]
    cord = np.hypot(d - 0.006, y - 1.075) - 0.0125 - 0.002 * np.cos(40 * turn + 300 * y)
    s.field[where] = soft_min(s.field[where], cord, 0.006)


def mantle(s: Sculpture) -> None:
    """A mantle slung from the right hip to the left arm, its rolled upper edge, and its fall from the arm."""
    where, p = s.part((-0.5, 0.1, -0.5), (0.5, 1.25, 0.5))
    x, y, z = np.moveaxis(p, -1, 0)
    d, turn = draped(p, SKIRT)
    d = soft_min(d, capsule(p, (0.10, 0.90, 0.05), (0.105, 0.50, 0.165), 0.095, 0.072), 0.10)
    top = 0.86 + 0.62 * x + 0.06 * np.cos(turn)
    lower = 0.33 + 0.35 * x + 0.03 * np.sin(3 * turn)
    lift = 0.030 + 0.010 * np.clip((y - lower) / 0.4, 0, 1)
    # The folds fan out from the left hip, where the arm gathers the cloth.
    fan = np.arctan2(1.02 - y, 0.34 - x + 0.12 * np.cos(turn))
    flow = fan + 0.05 * np.sin(9 * x) + 0.03 * np.sin(12 * y)
    knee = np.exp(-(((x - 0.10) / 0.11) ** 2 + ((y - 0.54) / 0.16) ** 2)) * (z > 0)
    folds = (0.020 * (1 - 0.6 * knee)) * pleat(11.5 * flow + 0.7) + 0.005 * pleat(27 * flow)
    cloth = d - lift - folds
    cloth = soft_max(cloth, y - top, 0.02)
    cloth = soft_max(cloth, lower - y + 0.02 * pleat(11.5 * flow + 0.7), 0.014)
    s.field[where] = np.minimum(s.field[where], cloth)
    roll = np.hypot(d - 0.034, (y - top) * 0.82) - 0.030 - 0.008 * pleat(5 * turn + 40 * (y - top))
    s.field[where] = soft_min(s.field[where], roll, 0.012)

    where, p = s.part((0.1, 0.2, -0.2), (0.5, 1.2, 0.4))
    fall = ((0.2, 0.085, 0.115), (0.5, 0.072, 0.105), (0.9, 0.055, 0.085), (1.04, 0.05, 0.08), (1.2, 0.045, 0.07))
    d, turn = draped(p, fall, (0.262, 0.09))
    y = p[..., 1]
    warped = turn + 0.2 * np.sin(2 * turn) + 0.08 * np.sin(8 * y)
    d = d - (0.012 + 0.022 * np.clip((1.05 - y) / 0.5, 0, 1)) * pleat(4.5 * warped)
    hem = 0.42 + 0.05 * np.abs(np.sin(4.5 * warped)) + 0.4 * (p[..., 2] - 0.09)
    d = soft_max(soft_max(d, hem - y, 0.012), y - 1.085, 0.05)
    s.field[where] = soft_min(s.field[where], d, 0.015)


STAFF = ((-0.385, 0.0, 0.235), (-0.345, 1.98, 0.195))


def arms(s: Sculpture) -> None:
    """The right arm holds a staff; the left, with the mantle over it, a bowl of fruit."""
    grip = np.add(STAFF[0], np.subtract(STAFF[1], STAFF[0]) * (1.36 / 1.98))
    right = [(-0.178, 1.385, -0.005), (-0.335, 1.185, -0.02), (-0.372, 1.335, 0.135)]
    left = [(0.178, 1.385, -0.005), (0.258, 1.115, -0.055), (0.225, 1.095, 0.175)]
    for shoulder, elbow, wrist in (right, left):
        s.rod(shoulder, elbow, 0.050, 0.040, 0.03)
        s.rod(elbow, wrist, 0.040, 0.026, 0.012)
        swell = np.add(elbow, np.subtract(wrist, elbow) * 0.28)
        s.rod(swell, np.add(elbow, np.subtract(wrist, elbow) * 0.45), 0.040, 0.034, 0.02)
    palm = np.add(grip, (-0.006, 0, -0.040))
    s.rod(right[2], palm, 0.024, 0.022, 0.02)
    for k in range(4):
        y = 0.030 - 0.0205 * k
        turn = np.radians(np.linspace(200, -40, 7))
        ring = np.stack([0.027 * np.sin(turn) * -1, np.full(7, y), 0.027 * np.cos(turn)], axis=-1) + grip
        for a, b in pairwise(ring):
            s.rod(a, b, 0.0105, 0.0100, 0.003)
    s.rod(np.add(palm, (0.0, 0.020, 0.0)), np.add(palm, (0.030, 0.045, 0.035)), 0.011, 0.0095, 0.008)

    hand = np.array((0.205, 1.098, 0.235))
    s.rod(left[2], hand, 0.024, 0.026, 0.02)
    bowl = np.array((0.195, 1.155, 0.275))
    for k, angle in enumerate(np.radians((-55, -25, 5, 35))):
        base = np.add(hand, (0.012 * (k - 1.5), 0.0, 0.012))
        tip = np.add(bowl, (0.085 * np.sin(angle), -0.018, 0.085 * np.cos(angle)))
        knuckle = (base + tip) / 2 + (0, -0.022, 0.012)
        s.rod(base, knuckle, 0.0115, 0.0105, 0.006)
        s.rod(knuckle, tip, 0.0105, 0.0085, 0.004)
    where, p = s.part(bowl - 0.15, bowl + 0.15)
    dish = np.abs(ellipsoid(p, np.add(bowl, (0, 0.02, 0)), (0.096, 0.062, 0.096))) - 0.007
    s.field[where] = np.minimum(s.field[where], soft_max(dish, p[..., 1] - bowl[1] - 0.02, 0.006))
    where, p = s.part(bowl - 0.1, bowl + 0.1)
    s.field[where] = soft_min(s.field[where], ellipsoid(p, bowl, (0.085, 0.022, 0.085)), 0.004)
    for x, y, z, r in (
        (0.0, 0.035, 0.035, 0.033),
        (0.042, 0.033, -0.015, 0.031),
        (-0.040, 0.033, -0.010, 0.032),
        (0.002, 0.068, -0.002, 0.032),
        (-0.035, 0.028, 0.045, 0.024),
        (0.045, 0.027, 0.042, 0.024),
        (0.0, 0.03, -0.055, 0.027),
    ):
        fruit = np.add(bowl, (x, y, z))
        where, p = s.part(fruit - 0.06, fruit + 0.06)
        s.field[where] = soft_min(s.field[where], np.linalg.norm(p - fruit, axis=-1) - r, 0.004)

    # Short sleeves, pinned along the shoulder.
    for shoulder, elbow, _ in (right, left):
        where, p = s.part((-0.42, 1.15, -0.15), (0.42, 1.5, 0.15))
        axis = unit(np.subtract(elbow, shoulder))
        along = (p - np.array(shoulder, np.float32)) @ axis.astype(np.float32)
        around = np.arctan2(p[..., 2] - shoulder[2], np.abs(p[..., 0] - shoulder[0]) * axis[1] + 1e-6)
        end = np.add(shoulder, axis * 0.16)
        sleeve = capsule(p, shoulder, end, 0.058, 0.070) - 0.008 * pleat(6 * around + 14 * along)
        s.field[where] = soft_min(
            s.field[where], soft_max(sleeve, along - 0.135 - 0.01 * np.cos(5 * around), 0.01), 0.02
        )


def face(q: np.ndarray) -> np.ndarray:
    """Distance to skull and face; q is in metres from the head's centre, (..., 3)."""
    mirrored = np.concatenate([np.abs(q[..., :1]), q[..., 1:]], axis=-1)
    d = ellipsoid(q, (0, 0.032, -0.012), (0.073, 0.088, 0.092))
    d = soft_min(d, ellipsoid(q, (0, -0.034, 0.026), (0.052, 0.084, 0.060)), 0.03)
    d = soft_min(d, ellipsoid(q, (0, -0.101, 0.062), (0.020, 0.017, 0.017)), 0.03)
    d = soft_min(d, ellipsoid(mirrored, (0.033, -0.028, 0.054), (0.023, 0.024, 0.022)), 0.03)
    d = soft_max(d, -ellipsoid(mirrored, (0.0315, 0.002, 0.097), (0.021, 0.0125, 0.021)), 0.012)
    for a, b, ra, rb, k in (
        ((0.010, 0.0180, 0.0830), (0.031, 0.0225, 0.0800), 0.0044, 0.0044, 0.012),
        ((0.031, 0.0225, 0.0800), (0.051, 0.0130, 0.0630), 0.0044, 0.0034, 0.012),
    ):
        d = soft_min(d, capsule(mirrored, a, b, ra, rb), k)
    d = soft_min(d, ellipsoid(mirrored, (0.0315, -0.0005, 0.0690), (0.0175, 0.0110, 0.0145)), 0.002)
    for a, b, ra, rb, k in (
        ((0.0155, -0.001, 0.0785), (0.0250, 0.0080, 0.0830), 0.0026, 0.0034, 0.002),
        ((0.0250, 0.0080, 0.0830), (0.0370, 0.0082, 0.0810), 0.0034, 0.0034, 0.002),
        ((0.0370, 0.0082, 0.0810), (0.0500, -0.001, 0.0690), 0.0034, 0.0024, 0.002),
        ((0.0, 0.026, 0.0850), (0.0, -0.029, 0.1085), 0.0066, 0.0086, 0.011),
        ((0.0, -0.0580, 0.0900), (0.0235, -0.0640, 0.0775), 0.0050, 0.0026, 0.005),
        ((0.0, -0.0720, 0.0885), (0.0200, -0.0675, 0.0780), 0.0062, 0.0028, 0.006),
    ):
        d = soft_min(d, capsule(mirrored, a, b, ra, rb), k)
    d = soft_min(d, ellipsoid(mirrored, (0.0098, -0.0335, 0.0955), (0.0068, 0.0062, 0.0088)), 0.005)
    d = soft_max(d, -capsule(mirrored, (0.0, -0.0648, 0.0970), (0.0255, -0.0655, 0.0805), 0.0026, 0.0018), 0.003)
    d = soft_max(d, -ellipsoid(q, (0, -0.0845, 0.0975), (0.015, 0.0070, 0.0095)), 0.010)
    return soft_min(d, ellipsoid(mirrored, (0.073, -0.006, -0.004), (0.010, 0.026, 0.016)), 0.006)


def hair(q: np.ndarray) -> np.ndarray:
    """Distance to wavy hair, parted in the middle and drawn back into a knot."""
    x, y, z = np.moveaxis(q, -1, 0)
    cap = ellipsoid(q, (0, 0.036, -0.016), (0.085, 0.097, 0.102))
    side = np.arctan2(y - 0.01, np.abs(x))
    strands = pleat(15 * side + 1.1 * np.sin(62 * z + 4 * side)) + 0.3 * pleat(37 * side + 1.8 * np.sin(62 * z))
    parting = np.exp(-((x / 0.008) ** 2)) * (z > -0.02)
    cap = cap - 0.0065 * strands + 0.006 * parting
    # Behind a line from the top of the brow down past the temples.
    line = 0.064 - 0.50 * np.clip(0.062 - y, 0, 1) + 0.10 * np.clip(y - 0.062, 0, 1) + 0.003 * strands
    cap = soft_max(cap, z - line, 0.010)
    cap = soft_max(cap, -0.075 - y + 0.25 * (z + 0.05), 0.02)
    knot = ellipsoid(q, (0, 0.005, -0.128), (0.047, 0.045, 0.040))
    knot = knot - 0.006 * pleat(4 * np.arctan2(y - 0.005, x) + 60 * np.hypot(x, y - 0.005))
    return soft_min(cap, knot, 0.015)


def head(s: Sculpture) -> None:
    """Neck, head, hair and a laurel wreath."""
    where, p = s.part((-0.25, 1.2, -0.2), (0.25, 1.6, 0.2))
    skin = ellipsoid(p, (0, 1.325, 0.0), (0.150, 0.118, 0.088))
    for side in (-1, 1):
        skin = soft_min(
            skin, capsule(p, (side * 0.02, 1.44, -0.022), (side * 0.165, 1.392, -0.008), 0.038, 0.042), 0.04
        )
    skin = soft_min(skin, capsule(p, (0, 1.40, -0.012), (0.006, 1.565, 0.004), 0.053, 0.044), 0.06)
    s.field[where] = soft_min(s.field[where], skin, 0.004)
    center = np.array((0.008, 1.636, 0.022), np.float32)
    pose = (rotation("y", 14) @ rotation("x", 6) @ rotation("z", -3)).astype(np.float32)
    where, p = s.part(center - 0.2, center + 0.2)
    q = (p - center) @ pose / np.float32(1.06)
    s.field[where] = soft_min(s.field[where], face(q) * 1.06, 0.022)
    s.field[where] = soft_min(s.field[where], hair(q) * 1.06, 0.004)
    for side in (-1, 1):
        for turn in np.radians(np.linspace(7, 150, 13)):
            height = 0.090 - 0.026 * (1 - np.cos(turn))
            reach = np.sqrt(1 - ((height - 0.036) / 0.101) ** 2)
            at = np.array((side * 0.090 * reach * np.sin(turn), height, -0.016 + 0.107 * reach * np.cos(turn)))
            for upper in (-1, 1):
                forward = unit((-side * np.cos(turn), 0.15 + 0.62 * upper, np.sin(turn)))
                tip = at + 0.030 * forward + 0.009 * unit(at * (1, 0.3, 1))
                leaf = capsule(q, at, (at + tip) / 2, 0.0035, 0.0070)
                leaf = soft_min(leaf, capsule(q, (at + tip) / 2, tip, 0.0070, 0.0018), 0.002)
                s.field[where] = soft_min(s.field[where], leaf * 1.06, 0.0015)


def feet(s: Sculpture) -> None:
    """Bare toes under the hem."""
    for heel, ball in (((0.115, 0.03, 0.14), (0.137, 0.020, 0.272)), ((-0.085, 0.03, 0.10), (-0.105, 0.020, 0.242))):
        side = np.sign(ball[0])
        s.rod(heel, ball, 0.045, 0.026, 0.01)
        for k in range(5):
            root = np.add(ball, (side * (0.015 * k - 0.026), -0.002, 0.004 - 0.004 * k))
            size = 0.0135 if k == 0 else 0.0105 - 0.0006 * k
            s.rod(root, np.add(root, (side * 0.003, -0.006, 0.034 - 0.003 * k)), size, size * 0.92, 0.004)


def detail(points: np.ndarray) -> np.ndarray:
    """How much the shape counts at each place: face and hands are small, and looked at first."""
    face_near = np.exp(-((np.linalg.norm(points - (0.03, 1.64, 0.09), axis=1) / 0.10) ** 2))
    hand_near = np.exp(-((np.linalg.norm(points - (-0.36, 1.36, 0.20), axis=1) / 0.07) ** 4))
    return 1 + 12 * face_near + 8 * hand_near


def plinth() -> Mesh:
    """A turned drum with base and cap mouldings."""
    bead = np.radians(np.linspace(-90, 90, 9))
    torus = [(0.385 + 0.035 * np.cos(t), 0.095 + 0.035 * np.sin(t)) for t in bead]
    hollow = [
        (0.335 + 0.05 * (1 - np.sin(t)), 0.145 + 0.04 * (1 - np.cos(t))) for t in np.radians(np.linspace(0, 90, 6))
    ]
    cap = [(0.335 + 0.055 * np.sin(t) ** 2, 0.355 + 0.045 * t / 1.571) for t in np.linspace(0, np.pi / 2, 8)]
    rows = [(0.43, 0.0), (0.43, 0.05), (0.425, 0.055), (0.39, 0.06), *torus, (0.385, 0.135), *hollow, (0.335, 0.19)]
    rows += [
        (0.330, 0.34),
        (0.335, 0.345),
        *cap,
        (0.40, 0.405),
        (0.405, 0.41),
        (0.405, 0.445),
        (0.39, DRUM),
        (0.0, DRUM),
    ]
    return revolve(np.array(rows) * [1.17, 1.0], 72, angle_deg=35)


def staff() -> Mesh:
    """A slender staff with a pine-cone finial."""
    low, high = np.array(STAFF[0]), np.array(STAFF[1])
    t = np.array([0.0, 0.02, 0.93, 0.935, 0.94, 0.945, 0.955, 0.97, 0.985, 0.995, 1.0])
    radius = np.array([0.017, 0.015, 0.013, 0.024, 0.024, 0.014, 0.030, 0.036, 0.028, 0.012, 0.002])
    return tube(low + t[:, None] * (high - low), radius, 16)


def carve(axes: tuple[np.ndarray, np.ndarray, np.ndarray], low: float, high: float, triangles: int) -> Mesh:
    """The figure between two heights, on a grid of its own."""
    s = Sculpture(axes)
    robe(s)
    mantle(s)
    arms(s)
    head(s)
    feet(s)
    return s.polygon(low, high, triangles, detail)


def make_statue(folder: Path) -> None:
    """Write statue.glb."""
    cut, overlap = 1.500, 0.008
    body = carve(
        (np.arange(-0.50, 0.40, 0.0068), np.arange(-0.03, 1.55, 0.0080), np.arange(-0.34, 0.42, 0.0068)),
        -0.012,
        cut,
        52_000,
    )
    fine = (np.arange(-0.13, 0.15, 0.0022), np.arange(1.47, 1.81, 0.0022), np.arange(-0.18, 0.16, 0.0022))
    crown = carve(fine, cut - overlap, 2.0, 25_000)
    shape = merge([merge([body, crown, staff()]).moved(y=DRUM), plinth()])
    glb = Glb("statue")
    marble = glb.add_material("marble", "#d9d3c6", roughness=0.65)
    glb.add_node("statue", glb.add_mesh("statue", [(shape, marble)]))
    glb.save(folder / "statue.glb")
