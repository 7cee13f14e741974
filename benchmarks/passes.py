"""Table "passes": what each part of a frame takes, of a forest one flies through and of a crowd one walks along."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from typing import Any
from unittest.mock import patch

import moderngl
import numpy as np

from bake.fan import bake_fan
from benchmarks.crowd import NAMES, SUN_STEP_DEG, Crowd
from benchmarks.crowd import SIZE as TILE
from benchmarks.flight import FPS, SCENE
from benchmarks.report import machine_kind
from benchmarks.scenes import HEIGHT, WIDTH
from benchmarks.tables import Row, Table
from benchmarks.workbench import SAMPLES, Workbench, say
from impostor.model import load_model
from impostor.scene import Scene
from runtime.fans import batch, colormap_pass, impostor_pass, lod, relighting
from runtime.gl.canvas import Canvas
from runtime.ground.ground_pass import GroundPass
from runtime.meshes.mesh_pass import MeshPass
from runtime.shadows import strips
from runtime.shadows.darkening import DarkeningPass
from runtime.shadows.marks import MarkPass
from runtime.walk.cli import ready_scene
from runtime.walk.walk import Walk

FRAMES, WARM_UP = 24, 3
START = 4.0  # seconds along the forest's path
COUNT = 10_000
PARTS: dict[str, tuple[str, tuple[tuple[Any, str], ...]]] = {
    "levels": ("levels of detail: which copies are meshes", ((lod.Levels, "update"), (lod.Levels, "copies"))),
    "choice": ("selection and culling: which copies, which views", ((batch.Batch, "shown_to"),)),
    "tiles": ("places of tiles, records, sorting, upload", ((impostor_pass.ImpostorPass, "_arrange"),)),
    "colormaps": ("colormaps", ((colormap_pass.ColormapPass, "write"),)),
    "relight": ("tiles through their colormaps", ((relighting.Relighter, "relight"),)),
    "quads": ("impostor quads", ((impostor_pass._Drawing, "render"),)),
    "meshes": ("meshes", ((MeshPass, "draw_copies"),)),
    "casters": ("shadows: which copies cast", ((strips.CastingFan, "of"),)),
    "marks": ("shadows: marks of strips", ((MarkPass, "draw"),)),
    "darken": ("shadows: darkening the ground", ((DarkeningPass, "draw"),)),
    "ground": ("ground", ((GroundPass, "draw"),)),
    "clear": ("clearing the picture", ((Canvas, "clear"),)),
}
"""Rows, and the calls whose time they count, without that of other rows inside them."""


class Clock:
    """Seconds of each part of a frame: the GPU is waited for wherever one ends and another begins."""

    def __init__(self, ctx: moderngl.Context):
        self._finish, self._now, self._stack = ctx.finish, clock_of(ctx), ["rest"]
        self._since = self._now()
        self.seconds: dict[str, float] = defaultdict(float)
        self.colormaps = 0

    def turn(self) -> None:
        """Count what has passed since the last turn for the part that is running."""
        self._finish()
        now = self._now()
        self.seconds[self._stack[-1]] += now - self._since
        self._since = now

    def timed(self, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """A function whose time counts for a part."""

        def call(*arguments: Any, **named: Any) -> Any:
            if part == "colormaps":
                self.colormaps += len(arguments[1])
            self.turn()
            self._stack.append(part)
            try:
                return function(*arguments, **named)
            finally:
                self.turn()
                self._stack.pop()

        return call


def clock_of(ctx: moderngl.Context) -> Callable[[], float]:
    """Seconds; where the processor draws, those of all its cores together, which other programs do not lengthen."""
    return time.process_time if machine_kind(ctx.info["GL_RENDERER"]) == "software-gl" else time.perf_counter


@contextmanager
def parts_timed(ctx: moderngl.Context) -> Iterator[Clock]:
    """Time the parts of all frames that are drawn in the block."""
    clock = Clock(ctx)
    with ExitStack() as stack:
        for part, (_, calls) in PARTS.items():
            for owner, name in calls:
                found = vars(owner)[name]
                is_class = isinstance(found, classmethod)
                timed: Any = clock.timed(part, found.__func__ if is_class else found)
                stack.enter_context(patch.object(owner, name, classmethod(timed) if is_class else timed))
        clock.turn()
        clock.seconds.clear()
        yield clock
        clock.turn()


def run(bench: Workbench) -> Table:
    """Split frames of three scenes."""
    forest = ready_scene(SCENE)
    say("passes: baking")
    fans = [bake_fan(load_model(SAMPLES / name), size=TILE) for name in NAMES]
    scenes = {
        "forest": ("forest", lambda: _Forest(bench.ctx, forest)),
        "near": ("forest, meshes near", lambda: _Forest(bench.ctx, _with_meshes(forest))),
        "crowd": (f"crowd of {COUNT:,}", lambda: Crowd(bench.ctx, fans, COUNT)),
    }
    columns = {f"{key}_{unit}": f"{label}, {unit}" for key, (label, _) in scenes.items() for unit in ("ms", "%")}
    table = Table("passes", f"Where a frame's time goes: {WIDTH} x {HEIGHT}, viewer and sun moving", columns)
    rows: dict[str, dict[str, float | None]] = defaultdict(dict)
    for key, (label, make) in scenes.items():
        say(f"passes: {label}")
        scene = make()
        values = measured(bench.ctx, scene.shadows_and_all)
        scene.release()
        whole = values["whole"]
        for part, value in values.items():
            rows[part][f"{key}_ms"] = value
            rows[part][f"{key}_%"] = None if part in COUNTS else 100 * value / whole
    labels = {part: label for part, (label, _) in PARTS.items()}
    labels |= {"rest": "the rest: camera, OpenGL state, lights", "whole": "the whole frame", **COUNTS}
    table.rows += [Row(part, label, rows[part]) for part, label in labels.items()]
    table.notes.append(
        f"Medians of {FRAMES} frames in a row. The GPU is waited for (glFinish) wherever one part ends and the next "
        "begins; what a part does on the CPU and its draw calls are counted together. On a software rasteriser the "
        "milliseconds are of processor time, all cores added up. The forest: scenes/forest.toml at 30 frames a "
        "second along its camera path, its sun 0.1 degrees on in every frame; with meshes, every copy above 256 pixels "
        f"is one. The crowd: that of the table `crowd`, its sun {SUN_STEP_DEG} degrees on in every frame."
    )
    return table


COUNTS = {
    "not_waited": "the frame, waited for only at its end, ms",
    "rewritten": "colormaps rewritten in a frame",
    "a_second": f"colormaps rewritten a second, at {FPS} frames a second",
}


def measured(ctx: moderngl.Context, frame: Callable[[], object]) -> dict[str, float]:
    """Milliseconds of each part of a frame, and what `COUNTS` says; medians, but for the colormaps, which are means."""
    for _ in range(WARM_UP):
        frame()
    now = clock_of(ctx)
    samples, counts, whole = [], [], []
    for _ in range(FRAMES):
        # In turns, so that both see the same stretch of the way.
        with parts_timed(ctx) as clock:
            frame()
        samples.append([clock.seconds[part] for part in (*PARTS, "rest")])
        counts.append(clock.colormaps)
        ctx.finish()
        started = now()
        frame()
        ctx.finish()
        whole.append(now() - started)
    parts = 1e3 * np.median(samples, axis=0)
    values = dict(zip((*PARTS, "rest"), parts.tolist(), strict=True))
    rewritten = float(np.mean(counts))
    return values | {
        "whole": float(parts.sum()),
        "not_waited": 1e3 * float(np.median(whole)),
        "rewritten": rewritten,
        "a_second": rewritten * FPS,
    }


class _Forest:
    """The flight along the camera path."""

    def __init__(self, ctx: moderngl.Context, scene: Scene):
        self._walk = Walk(ctx, scene, (WIDTH, HEIGHT))
        self._walk.follow_path()
        self._walk.step(START)

    def shadows_and_all(self) -> None:
        """The next frame."""
        self._walk.step(1 / FPS)
        self._walk.draw()

    def release(self) -> None:
        """Free everything on the GPU."""
        self._walk.release()


def _with_meshes(scene: Scene) -> Scene:
    return replace(scene, instances=tuple(replace(each, lod=True) for each in scene.instances))
