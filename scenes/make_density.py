"""The density picture of `forest.toml`: thick woods with a clearing, and a path that winds through it.

python scenes/make_density.py [--out PNG]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from PIL import Image

SIDE = 128


def density() -> np.ndarray:
    """(SIDE, SIDE) uint8: white where trees are likeliest, black where none stand."""
    row, column = np.mgrid[:SIDE, :SIDE]
    x, z = (column + 0.5) / SIDE * 2 - 1, (row + 0.5) / SIDE * 2 - 1
    clearing = np.clip((np.hypot(x, z) - 0.13) / 0.08, 0, 1)
    path = np.clip((np.abs(x - 0.12 * np.sin(5 * z)) - 0.035) / 0.02, 0, 1)
    patches = 0.7 + 0.3 * np.sin(7 * x + 2 * np.sin(3 * z)) * np.sin(6 * z + np.sin(4 * x))
    return np.round(255 * clearing * path * patches).astype(np.uint8)


def main() -> None:
    """Write the picture."""
    parser = argparse.ArgumentParser(description="Make the density picture of the forest.")
    parser.add_argument("--out", type=Path, default=Path(__file__).with_name("forest_density.png"))
    Image.fromarray(density()).save(parser.parse_args().out, optimize=True)


if __name__ == "__main__":
    main()
