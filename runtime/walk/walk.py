"""A walk through a scene: what keys and mouse do to it, how time goes on, what is drawn. No window."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import wrap

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.camera_path import camera_at
from impostor.errors import ImpostorError
from impostor.scene import Scene
from runtime.gl.canvas import Canvas
from runtime.gl.draw_calls import counted_draw_calls
from runtime.gl.memory import memory_held
from runtime.stage.changes import Change, SceneChanges
from runtime.stage.stage import VIEWS, Stage
from runtime.viewing.cameras import Camera
from runtime.walk.frame_statistics import FrameStatistics
from runtime.walk.keys import HELD, HELP
from runtime.walk.overlay import LEADING, Overlay, Panel, Row
from runtime.walk.sun_control import SunControl
from runtime.walk.walker import MOVES, TURNS, Walker

LOOK_RATE = np.radians(0.15)  # a pixel of the mouse
SUN_RATE = np.radians(0.25)
CLOCK_RATE = 2.0  # hours a second, while a key is held
SPEED, HALF_GREY = 1.8, 7.0  # walking heights: a second, and away in the view of distances
MESSAGE_SECONDS, HINT_SECONDS = 4.0, 8.0
HINT = "H: help"
PATIENCE = 0.25  # seconds between two looks at the scene's files, and between two texts of the statistics
LINE = 80  # characters of a message
SMALLEST_FONT = 9
BOTH_WIDE = 58  # font sizes from which on statistics and help have room side by side
MARGIN = 8  # pixels around what lies over the picture


@dataclass
class Shown:
    """What of the scene is shown, and what over it; `split` is the divider's part of the width."""

    view: str = "lit"
    shadows: bool = True
    dither: bool = False
    split: float | None = None
    statistics: bool = True
    help: bool = False


class Walk:
    """A scene, someone who walks in it, and the picture that is seen.

    Parameters
    ----------
    ctx : moderngl.Context
    scene : Scene
        Whose fans are all there.
    size : tuple of int
        Of the picture, pixels.
    samples : int
        Of every pixel.
    changes : SceneChanges, optional
        What changes in the scene's files while the walk goes on.
    font_size : int
        Pixels.

    Attributes
    ----------
    stage : Stage
    walker : Walker
    sun : SunControl
    canvas : Canvas
    shown : Shown
    statistics : FrameStatistics
    held : set of str
        Actions whose keys are down.
    follows_path : bool
        Whether the scene's camera path leads.

    Raises
    ------
    ImpostorError
        As `Stage` and `Canvas`.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        scene: Scene,
        size: tuple[int, int],
        samples: int = 1,
        changes: SceneChanges | None = None,
        font_size: int = 14,
    ):
        self._ctx, self._samples, self._changes = ctx, samples, changes
        self.held: set[str] = set()
        self.shown, self.statistics, self.sun = Shown(), FrameStatistics(), SunControl(scene)
        self.follows_path, self._path_time = False, 0.0
        self._message: tuple[str, ...] = ()
        self._message_left, self._complaint, self._hint_left = 0.0, "", HINT_SECONDS
        self._since_look, self._since_rows, self._rows = 0.0, np.inf, ()
        self.canvas = Canvas(ctx, *size, samples)
        try:
            self.stage = Stage(ctx, scene)
        except BaseException:
            self.canvas.release()
            raise
        self._overlay, self._font_size = Overlay(ctx), font_size
        self.walker = self._standing()

    @property
    def scene(self) -> Scene:
        """What is walked through."""
        return self.stage.scene

    def _standing(self) -> Walker:
        """Someone who stands where the scene's camera does."""
        camera, ground = self.scene.camera, self.scene.ground
        walker = Walker(
            np.array(camera.eye),
            speed=SPEED * camera.walking_height,
            ground_height=None if ground is None else lambda x, z: float(ground.heights(x, z)),
            walking_height=camera.walking_height,
        )
        walker.look_at(camera.eye, camera.target)
        if ground is not None:
            above = camera.eye[1] - float(ground.heights(camera.eye[0], camera.eye[2]))
            walker.flying = abs(above - camera.walking_height) > camera.walking_height / 4
        return walker

    def press(self, action: str) -> None:
        """Do what a key stands for; what is in `HELD` lasts until `let_go`, what is in `WINDOW` is for the window."""
        if action in HELD:
            self.held.add(action)
            if action in (*MOVES, *TURNS):
                self.follows_path = False
        elif action in VIEWS:
            self.shown.view = action
        elif action in ("shadows", "dither", "statistics", "help"):
            setattr(self.shown, action, not getattr(self.shown, action))
            self._hint_left *= action != "help"
        elif action == "fly":
            self.walker.flying = not self.walker.flying
            self.say("flying" if self.walker.flying else "walking")
        elif action == "time":
            self._toggle_time()
        elif action == "split":
            self._toggle_split()
        elif action == "return":
            self.follows_path, self.walker = False, self._standing()
            self.stage.renderer.advance(np.inf)
        elif action == "path":
            self.say("along the camera path" if self.follow_path() else "this scene has no camera path")
        else:
            raise ValueError(f"no action {action!r}")

    def let_go(self, action: str) -> None:
        """A key has been released."""
        self.held.discard(action)

    def look(self, right: float, down: float) -> None:
        """Turn the head with the mouse, which has moved so many pixels."""
        self.follows_path = False
        self.walker.turn(right * LOOK_RATE, -down * LOOK_RATE)

    def drag_sun(self, right: float, down: float) -> None:
        """Pull the sun with the mouse, pixels."""
        self.sun.drag(right * SUN_RATE, -down * SUN_RATE)

    def move_divider(self, right: float) -> None:
        """Move the divider of a split screen, pixels."""
        if self.shown.split is not None:
            self.shown.split = float(np.clip(self.shown.split + right / self.canvas.size[0], 0.0, 1.0))

    def follow_path(self) -> bool:
        """Let the scene's camera path lead, from its beginning; False where there is none."""
        self.follows_path, self._path_time = self.scene.camera.path is not None, 0.0
        if self.follows_path:
            self._along_path(0.0)
            self.stage.renderer.advance(np.inf)
        return self.follows_path

    def say(self, message: str) -> None:
        """Show a line for some seconds."""
        self._message, self._message_left = tuple(wrap(message, LINE)), MESSAGE_SECONDS

    def _toggle_time(self) -> None:
        self.sun.running = not self.sun.running
        goes = "goes on" if self.sun.running else "stands still"
        self.say(f"time {goes}" if self.sun.has_time else "nothing in this scene goes with time")

    def _toggle_split(self) -> None:
        try:
            self.stage.prepare_split()
        except ImpostorError as error:
            self.say(str(error))
        else:
            self.shown.split = 0.5 if self.shown.split is None else None

    def _along_path(self, seconds: float) -> None:
        path = self.scene.camera.path
        if path is None:
            self.follows_path = False
            return
        self._path_time += seconds
        self.walker.look_at(*camera_at(path, float(path.times[0]) + self._path_time))
        self.follows_path = self._path_time < path.duration

    def step(self, seconds: float) -> None:
        """Let time go on before the next picture."""
        if self.follows_path:
            self._along_path(seconds)
        else:
            self.walker.step(self.held, seconds)
        self.sun.turn_clock((("later" in self.held) - ("earlier" in self.held)) * CLOCK_RATE * seconds)
        self.sun.step(seconds)
        self.stage.renderer.advance(seconds)
        self._message_left -= seconds
        self._hint_left -= seconds
        self._since_look += seconds
        self._since_rows += seconds
        if self._since_look >= PATIENCE and self._changes is not None:
            self._since_look = 0.0
            self._look_at_files(self._changes)

    def _look_at_files(self, changes: SceneChanges) -> None:
        change = changes.poll()
        if change is not None:
            self._take(change)
        elif changes.message != self._complaint:
            self._complaint = changes.message
            self.say(changes.message)

    def _take(self, change: Change) -> None:
        try:
            self.stage.change(change.scene)
            if self.shown.split is not None:
                self.stage.prepare_split()
        except ImpostorError as error:
            self.say(str(error))
            return
        self.sun.change(change.scene, change.parts)
        if change.parts & {"camera", "ground"}:
            before, self.walker = self.walker, self._standing()
            if "camera" not in change.parts:
                self.walker.eye, self.walker.yaw, self.walker.pitch = before.eye, before.yaw, before.pitch
                self.walker.flying = before.flying
        self.say(f"changed: {', '.join(sorted(change.parts))}")

    @property
    def camera(self) -> Camera:
        """What is seen."""
        near, far = self.stage.range_from(self.walker.eye)
        width, height = self.canvas.size
        return self.walker.camera(self.scene.camera.fov_deg, width / height, near, far)

    def resize(self, size: tuple[int, int]) -> None:
        """Make the picture another size."""
        if size != self.canvas.size and min(size) > 0:
            self.canvas.release()
            self.canvas = Canvas(self._ctx, *size, self._samples)

    def draw(self) -> None:
        """Draw the picture, without what lies over it."""
        begun, shown, camera, lighting = time.perf_counter(), self.shown, self.camera, self.sun.lighting
        self.stage.light(lighting.lights, lighting.ambient, lighting.background, self.sun.room_yaws, self.sun.sky)
        self.stage.renderer.filtered = not shown.dither
        with counted_draw_calls() as calls:
            self.stage.draw(self.canvas, camera, shown.view, shown.shadows, shown.split)
        if shown.view == "depth":
            self.canvas.use_resolved()
            half_grey = HALF_GREY * self.walker.walking_height
            self._overlay.draw_distances(self.canvas.size, self.canvas.depth, camera.clip_from_view, half_grey)
        self._ctx.finish()
        self.statistics.add(time.perf_counter() - begun, calls.count, self.stage.statistics)

    def picture(self) -> NDArray[np.uint8]:
        """What `draw` drew, (H, W, 3) uint8, sRGB."""
        return self.canvas.pixels()

    def present(self) -> None:
        """Fill the bound framebuffer with the picture and what lies over it."""
        size = self.canvas.size
        self._overlay.draw_picture(size, self.canvas.color)
        if self.shown.split is not None:
            self._overlay.draw_divider(size, self.divider)
        self._overlay.draw_panels(size, self._panels(), self._fitting_font_size)

    @property
    def _fitting_font_size(self) -> int:
        """So that the help fits into a low window, as long as it can be read."""
        return max(min(self._font_size, int(self.canvas.size[1] / (len(HELP) + 2) / LEADING)), SMALLEST_FONT)

    @property
    def divider(self) -> int:
        """The column of pixels where the impostors begin; -1 where the screen is not split."""
        return -1 if self.shown.split is None else round(self.shown.split * self.canvas.size[0])

    def _panels(self) -> Sequence[Panel]:
        panels = []
        if self.shown.statistics and (self.canvas.size[0] > BOTH_WIDE * self._fitting_font_size or not self.shown.help):
            panels.append(Panel(self._statistics_rows(), (0, 0), (MARGIN, MARGIN)))
        if self.shown.help:
            panels.append(Panel(HELP, (1, 0), (-MARGIN, MARGIN)))
        elif self._hint_left > 0:
            panels.append(Panel((HINT,), (1, 0), (-MARGIN, MARGIN)))
        if self.shown.split is not None:
            for text, side in (("meshes", 1.0), ("impostors", 0.0)):
                offset = -MARGIN if side else MARGIN
                panels.append(Panel((text,), (self.shown.split, 1), (offset, -MARGIN), (side, 1)))
        if self._changes is not None and self._changes.baking:
            panels.append(Panel((f"baking {self._changes.baking}",), (0.5, 0.8)))
        if self._message_left > 0 and self._message:
            panels.append(Panel(self._message, (0.5, 0.9)))
        return panels

    def _statistics_rows(self) -> tuple[Row, ...]:
        if self._since_rows >= PATIENCE:
            self._since_rows = 0.0
            eye = ", ".join(f"{each:.2f}" for each in np.round(self.walker.eye, 2) + 0.0)
            spared = () if self.shown.split is not None else (f"{self.triangles_not_drawn:,} triangles",)
            self._rows = (
                *self.statistics.rows(),
                *(("not drawn", each) for each in spared),
                ("GPU memory", f"{sum(self.memory.values()) / 2**20:,.0f} MiB"),
                ("sun", self.sun.words),
                ("eye", f"{eye} m, {'flying' if self.walker.flying else 'walking'}"),
                *(("leaning", f"{name}, {off:.0f}° off its views") for name, off in self._most_leaning),
                ("view", f"{self.shown.view}{', every texel' * self.shown.dither}"),
            )
        return self._rows

    @property
    def leaning(self) -> dict[str, float]:
        """Fans seen from far beside their views, and by how many degrees."""
        return self.stage.leaning(self.camera, self.canvas.size)

    @property
    def _most_leaning(self) -> list[tuple[str, float]]:
        return sorted(self.leaning.items(), key=lambda each: -each[1])[:1]

    @property
    def triangles_not_drawn(self) -> int:
        """Of the meshes whose fans are seen in the last picture."""
        return self.stage.triangles_not_drawn(self.camera, self.canvas.size)

    @property
    def memory(self) -> dict[str, int]:
        """Bytes that the walk holds on the GPU, by kind; see `memory_held`."""
        return memory_held(self)

    def release(self) -> None:
        """Free everything on the GPU, and stop what is being baked."""
        if self._changes is not None:
            self._changes.stop()
        for part in (self.canvas, self._overlay, self.stage):
            part.release()
