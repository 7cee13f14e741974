"""What all tables share: the models, their fans and one OpenGL context."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import moderngl

from benchmarks.fresh_process import ROOT, Cost, run_fresh
from impostor.fan import Fan
from impostor.files.fan_file import read_fan
from impostor.model import Model, load_model
from runtime.gl.context import make_context

DATA = Path(os.environ.get("IMPOSTOR_DATA") or ROOT.parent / "shared" / "data")
SAMPLES = ROOT / "sample_models"
COMMAND = Path(sys.executable).with_name("impostor")


@dataclass(frozen=True)
class Subject:
    """A model that is measured.

    Parameters
    ----------
    key : str
    path : Path
    real : bool
        Whether it is the model the bars are stated for, not one that stands in for it.
    """

    key: str
    path: Path
    real: bool

    @property
    def label(self) -> str:
        """File name, and that it is a stand-in where it is."""
        return self.path.name if self.real else f"{self.path.name} (in place of the {self.key})"


class Workbench:
    """Loads and bakes what the tables ask for, each once in a run.

    Parameters
    ----------
    folder : Path
        Where fans are kept during the run.
    """

    def __init__(self, folder: Path):
        self.folder = folder
        self._models: dict[str, Model] = {}
        self._fans: dict[str, Fan] = {}
        self._costs: dict[str, Cost] = {}

    @cached_property
    def ctx(self) -> moderngl.Context:
        """The context that every pass runs in."""
        return make_context()

    def subject(self, key: str) -> Subject:
        """dragon, bunny, helmet, leaves or tree."""
        real = {
            "dragon": DATA / "models" / "stanford_dragon_871414.ply",
            "bunny": DATA / "models" / "stanford_bunny_69451.ply",
            "helmet": DATA / "models" / "DamagedHelmet.glb",
            "leaves": DATA / "models" / "tree_alpha_leaves.glb",
            "tree": SAMPLES / "tree.glb",
        }[key]
        if real.is_file():
            return Subject(key, real, True)
        stand_in = {"dragon": "statue.glb", "bunny": "shell.ply", "helmet": "house.glb", "leaves": "pine.obj"}[key]
        return Subject(key, SAMPLES / stand_in, False)

    def model(self, key: str) -> Model:
        """The mesh."""
        if key not in self._models:
            self._models[key] = load_model(self.subject(key).path)
        return self._models[key]

    def bake_cost(self, key: str) -> Cost:
        """`impostor bake MODEL` with the defaults, 96 views of 256 texels, in a fresh process."""
        if key not in self._costs:
            path = self.subject(key).path
            say(f"baking {path.name}")
            command = [str(COMMAND), "bake", str(path), "-o", str(self.fan_path(key)), "--quiet", "--force"]
            self._costs[key] = run_fresh(command)
        return self._costs[key]

    def fan_path(self, key: str) -> Path:
        """Where the baked fan lies, once it is baked."""
        return self.folder / f"{self.subject(key).path.stem}.fan"

    def fan(self, key: str) -> Fan:
        """The baked fan, as read from its file."""
        if key not in self._fans:
            if not self.fan_path(key).exists():
                self.bake_cost(key)
            self._fans[key] = read_fan(self.fan_path(key))
        return self._fans[key]


def say(text: str) -> None:
    """Progress, on standard error."""
    print(f"benchmarks: {text}", file=sys.stderr, flush=True)
