"""Table "crowd": up to 100,000 copies of eight fans on a plain that one looks over, and what each pass costs."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import contextmanager
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from bake.fan import bake_fan
from benchmarks.plain_quads import BILINEAR, PlainQuads
from benchmarks.scenes import AMBIENT, BACKGROUND, HEIGHT, WIDTH
from benchmarks.tables import Bar, Row, Table
from benchmarks.timing import alternate
from benchmarks.workbench import SAMPLES, Workbench, say
from impostor.fan import Fan
from impostor.lighting import DirectionalLight
from impostor.model import load_model
from impostor.shadow_projection import Ground
from runtime.gl.offscreen import Offscreen
from runtime.renderer import ImpostorRenderer
from runtime.viewing.cameras import Camera
from runtime.viewing.viewer import Viewer

NAMES = ("tree.glb", "pine.obj", "statue.glb", "house.glb", "truck.glb", "lattice.glb", "shell.ply", "knot.stl")
COUNTS = (1, 100, 1000, 10_000, 100_000)
SIZE = 128
TALL = 2.5  # metres
APART = 4.0  # metres, on average
SUN_STEP_DEG = 0.05  # a frame: a day of four minutes at 30 frames a second


class Crowd:
    """Copies of fans on a square, seen from its edge.

    Parameters
    ----------
    ctx : moderngl.Context
    fans : list of Fan
    count : int
    """

    def __init__(self, ctx: moderngl.Context, fans: list[Fan], count: int):
        self.ctx, self.target, self.renderer = ctx, Offscreen(ctx, WIDTH, HEIGHT), ImpostorRenderer(ctx)
        self.ground, self._azimuth, self._frame = Ground(np.array([0.0, 1.0, 0.0])), 40.0, 0
        random, self._side = np.random.default_rng(0), APART * np.sqrt(count) / 2
        for index, fan in enumerate(fans):
            copies = count // len(fans) + (index < count % len(fans))
            if copies:
                places = random.uniform(-self._side, self._side, (copies, 3)) * (1, 0, 1)
                height = fan.bounds[1, 1] - fan.bounds[0, 1]
                places[:, 1] = -fan.bounds[0, 1] * TALL / height
                self.renderer.add(fan, places, random.uniform(0, 2 * np.pi, copies), TALL / height)
        self.renderer.ambient = AMBIENT
        self.matrices = self._matrices(0)
        self.viewer = Viewer.from_matrices(*self.matrices, (0, 0, WIDTH, HEIGHT))
        self._light()

    def _matrices(self, step: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        eye = np.array([0.05 * step, 6.0, self._side + 8])
        return Camera.perspective(eye, eye - (0, 8, 40), 60, WIDTH / HEIGHT, 0.5, 2000).matrices

    def _light(self) -> None:
        self.renderer.lights = [DirectionalLight.from_angles(self._azimuth, 45, (0.8, 0.8, 0.8))]

    def still(self) -> None:
        """A frame in which nothing has changed."""
        self.target.clear(BACKGROUND)
        self.renderer.draw(*self.matrices)

    def walking(self) -> None:
        """A frame five centimetres on."""
        self._frame += 1
        self.target.clear(BACKGROUND)
        self.renderer.draw(*self._matrices(self._frame))

    def sun(self) -> None:
        """A frame under a sun that has moved on."""
        self._azimuth += SUN_STEP_DEG
        self._light()
        self.still()

    def shadows(self) -> None:
        """The shadows of a frame five centimetres on."""
        self._frame += 1
        self.target.clear(BACKGROUND)
        self.renderer.draw_shadows(*self._matrices(self._frame), self.ground)

    def shadows_and_all(self) -> None:
        """Shadows and copies of a frame five centimetres on, under a sun that has moved on."""
        self._azimuth += SUN_STEP_DEG
        self._light()
        self.shadows()
        self.renderer.draw(*self._matrices(self._frame))

    def release(self) -> None:
        """Free everything on the GPU."""
        self.renderer.release()
        self.target.release()


def run(bench: Workbench) -> Table:
    """Frames of crowds."""
    columns = {
        "instances": "instances",
        "seen": "in the picture",
        "plain_ms": "plain quads, ms",
        "still_ms": "still, ms",
        "still_ratio": "still / plain",
        "walking_ms": "viewer walks, ms",
        "cpu_ms": "of that CPU, ms",
        "sun_ms": "sun creeps on, ms",
        "sun_ratio": "sun / still",
        "shadows_ms": "shadows, viewer walks, ms",
        "memory_mib": "on the GPU, MiB",
    }
    table = Table("crowd", "Crowds: eight fans, up to 100,000 copies", columns)
    fans = [bake_fan(load_model(SAMPLES / name), size=SIZE) for name in NAMES]
    for count in COUNTS:
        say(f"crowd: {count:,} instances")
        crowd = Crowd(bench.ctx, fans, count)
        crowd.still()
        plain = PlainQuads(crowd)  # type: ignore[arg-type]
        plain.prepare(BILINEAR)
        still = alternate(lambda plain=plain: plain.draw(BILINEAR), crowd.still, ctx=bench.ctx)
        seen = crowd.renderer.statistics["instances"]
        # Alone: a still frame in between would relight what the sun's frame has left.
        sun = alternate(crowd.sun, ctx=bench.ctx, repeats=25)
        walking = alternate(crowd.walking, ctx=bench.ctx).median(0)
        with _nothing_drawn():
            crowd.target.framebuffer.use()
            cpu = alternate(crowd.walking).median(0)
        shadows = alternate(crowd.shadows, ctx=bench.ctx, repeats=3, warm_up=1).median(0)
        values = {
            "instances": count,
            "seen": seen,
            "plain_ms": still.median(0) * 1e3,
            "still_ms": still.median(1) * 1e3,
            "still_ratio": still.ratio(1, 0),
            "walking_ms": walking * 1e3,
            "cpu_ms": cpu * 1e3,
            "sun_ms": sun.median(0) * 1e3,
            "sun_ratio": sun.median(0) / still.median(1),
            "shadows_ms": shadows * 1e3,
            "memory_mib": sum(crowd.renderer.memory.values()) / 2**20,
        }
        bars = {
            10_000: (Bar("still_ratio", "<=", 2.5), Bar("cpu_ms", "<", 8.0), Bar("sun_ratio", "<", 1.3)),
            100_000: (Bar("cpu_ms", "<", 60.0),),
        }
        table.rows.append(Row(str(count), f"{count:,} instances", values, bars.get(count, ())))
        plain.release()
        crowd.release()
    table.notes.append(
        f"{WIDTH} x {HEIGHT} pixels, objects {TALL} m tall about {APART:g} m apart, each turned another way, "
        f"seen from the edge of the square; {len(NAMES)} fans of 96 views of {SIZE} x {SIZE}. The sun moves "
        f"{SUN_STEP_DEG} degrees in every frame. CPU: `draw` with every OpenGL draw call left out."
    )
    return table


@contextmanager
def _nothing_drawn() -> Any:
    """No vertex array draws."""
    render: Callable[..., None] = moderngl.VertexArray.render
    moderngl.VertexArray.render = lambda *_, **__: None  # type: ignore[method-assign]
    try:
        yield
    finally:
        moderngl.VertexArray.render = render  # type: ignore[method-assign]
