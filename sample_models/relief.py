"""A carved rosette as a capture set: 40 photographs under the geodesic dome of HPL-98-131, and heights to make them of.

python sample_models/relief.py [--out FOLDER]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bake.dome import geodesic_dome
from bake.reliefs import write_capture
from bake.synthetic_capture import Relief, photograph

SIDE = 128
QUALITY = 88


def rosette() -> Relief:
    """Eight petals about a boss, in a ring with pegs, on slightly rough stone that turns reddish outward."""
    row, column = np.mgrid[:SIDE, :SIDE]
    x, y = (column + 0.5) / SIDE * 2 - 1, 1 - (row + 0.5) / SIDE * 2
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    reach = 0.38 + 0.3 * np.abs(np.cos(4 * angle)) ** 0.7
    petals = (
        9 * np.sqrt(np.clip(1 - (radius / reach) ** 4, 0, None)) * (0.75 + 0.25 * np.cos(16 * angle) * (radius > 0.3))
    )
    boss = 13 * np.sqrt(np.clip(1 - (radius / 0.24) ** 2, 0, None))
    ring = 7 * np.sqrt(np.clip(1 - ((radius - 0.86) / 0.07) ** 2, 0, None))
    peg_x, peg_y = np.abs(np.abs(x) - 0.86), np.abs(np.abs(y) - 0.86)
    pegs = 10.0 * (np.maximum(peg_x, peg_y) < 0.07)
    rough = np.random.default_rng(7).normal(size=(SIDE, SIDE))
    spectrum = np.hypot(np.fft.fftfreq(SIDE)[:, None], np.fft.fftfreq(SIDE)[None])
    rough = np.fft.ifft2(np.fft.fft2(rough) * np.exp(-((spectrum / 0.08) ** 2))).real
    heights = np.maximum.reduce([petals, boss, ring, pegs]) + 2.5 * rough
    stone, clay = np.array([0.62, 0.58, 0.5]), np.array([0.58, 0.34, 0.22])
    share = np.clip((radius - 0.5) / 0.3, 0, 1)[..., None]
    return Relief(heights, (1 - share) * stone + share * clay, gloss=0.25, shininess=30)


def make_relief(out: Path) -> None:
    """Write `relief/rosette.lp` and its photographs."""
    folder = out / "relief"
    folder.mkdir(parents=True, exist_ok=True)
    lights = geodesic_dome()
    write_capture(list(photograph(rosette(), lights)), lights, folder / "rosette.lp", quality=QUALITY, force=True)


def main() -> None:
    """Make the capture set."""
    parser = argparse.ArgumentParser(description="Make the sample capture set.")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="folder to write to; default here")
    make_relief(parser.parse_args().out)


if __name__ == "__main__":
    main()
