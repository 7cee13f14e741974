"""Runs a command in a process of its own: how long it takes and how much memory it needs at most."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Cost:
    """What a command took.

    Parameters
    ----------
    seconds : float
        From its start to its end.
    peak_bytes : float or None
        Largest resident size; None where the system does not tell.
    output : str
        What it printed on standard output.
    """

    seconds: float
    peak_bytes: float | None
    output: str


def run_fresh(command: Sequence[str]) -> Cost:
    """Run a command from the project's root.

    Raises
    ------
    RuntimeError
        It failed; the message is the end of what it wrote on standard error.
    """
    # A process starts with its parent's peak memory: one small process in between keeps ours out of the number.
    done = subprocess.run([sys.executable, __file__, *command], capture_output=True, text=True, cwd=ROOT)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr.strip()[-2000:]}")
    return Cost(**json.loads(done.stdout))


def _peak_bytes() -> float | None:
    try:
        import resource
    except ImportError:
        return None
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * unit


def _main() -> int:
    start = time.perf_counter()
    done = subprocess.run(sys.argv[1:], stdout=subprocess.PIPE, text=True)
    seconds = time.perf_counter() - start
    print(json.dumps({"seconds": seconds, "peak_bytes": _peak_bytes(), "output": done.stdout}))
    return done.returncode


if __name__ == "__main__":
    sys.exit(_main())
