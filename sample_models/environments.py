"""Two environment maps: a meadow under a high sun, and a study of 4 x 3 x 6 metres.

python sample_models/environments.py [--out FOLDER]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import meadow
import study

HEIGHT, SAMPLES = 384, 4
COMPRESSION = "dwaa:110"  # lossy, and a fifth of what lossless takes


def panorama(radiance: Callable[[np.ndarray], np.ndarray], height: int) -> np.ndarray:
    """(height, 2 height, 3) float32: the mean of SAMPLES x SAMPLES directions a texel, -Z in the middle."""
    total = np.zeros((height, 2 * height, 3))
    for row in range(SAMPLES):
        for column in range(SAMPLES):
            down = (np.arange(height) + (row + 0.5) / SAMPLES) * (np.pi / height)
            turn = (np.arange(2 * height) + (column + 0.5) / SAMPLES) * (np.pi / height)
            level = np.sin(down)[:, None]
            up = np.broadcast_to(np.cos(down)[:, None], total.shape[:2])
            total += radiance(np.stack([-level * np.sin(turn), up, level * np.cos(turn)], axis=-1))
    return (total / SAMPLES**2).astype(np.float32)


def write(path: Path, picture: np.ndarray) -> None:
    """A compressed EXR file of half floats, the same bytes on every run."""
    spec = oiio.ImageSpec(picture.shape[1], picture.shape[0], 3, "half")
    for name, value in (("compression", COMPRESSION), ("DateTime", ""), ("Copyright", "CC0 1.0")):
        spec.attribute(name, value)
    output = oiio.ImageOutput.create(str(path))
    if not (output and output.open(str(path), spec) and output.write_image(picture) and output.close()):
        raise OSError(f"{path}: {oiio.geterror()}")


def make_environments(out: Path) -> None:
    """Write `environments/meadow.exr` and `environments/study.exr`."""
    folder = out / "environments"
    folder.mkdir(parents=True, exist_ok=True)
    write(folder / "meadow.exr", panorama(meadow.radiance, HEIGHT))
    write(folder / "study.exr", panorama(study.radiance, HEIGHT))


def main() -> None:
    """Make both maps."""
    parser = argparse.ArgumentParser(description="Make the sample environment maps.")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="folder to write to; default here")
    make_environments(parser.parse_args().out)


if __name__ == "__main__":
    main()
