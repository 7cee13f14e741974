"""Make the sample models: the same files, byte for byte, on every run.

python sample_models/make_samples.py [--out FOLDER] [NAME ...]
"""

from __future__ import annotations

import argparse
import importlib
from pathlib import Path

MAKERS = {
    "tree": "trees",
    "pine": "trees",
    "statue": "statue",
    "house": "house",
    "lattice": "lattice",
    "truck": "truck",
    "shell": "shell",
    "knot": "shell",
}


def main() -> None:
    """Make the models named on the command line, or all."""
    parser = argparse.ArgumentParser(description="Make the sample models.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"which to make: {', '.join(MAKERS)}; default all")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="folder to write to; default here")
    options = parser.parse_args()
    unknown = sorted(set(options.names) - set(MAKERS))
    if unknown:
        parser.error(f"unknown model {unknown[0]!r}, expected one of {', '.join(MAKERS)}")
    options.out.mkdir(parents=True, exist_ok=True)
    for name in options.names or MAKERS:
        getattr(importlib.import_module(MAKERS[name]), f"make_{name}")(options.out)


if __name__ == "__main__":
    main()
