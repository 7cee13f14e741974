"""The window of a walk: the one importer of moderngl_window."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Any

import moderngl

from impostor.errors import GpuError
from runtime.walk.keys import KEYS, WINDOW
from runtime.walk.overlay import Overlay, Panel
from runtime.walk.walk import Walk

LONGEST_STEP = 0.1  # seconds: after a pause nobody has walked on
GRAB = 8  # pixels on either side of the divider
LEFT, RIGHT = 1, 2  # buttons of the mouse


class Window:
    """A window that a walk is seen in and led from.

    Parameters
    ----------
    title : str
    size : tuple of int
        Pixels.
    catch_mouse : bool
        Whether the mouse belongs to the window from the beginning.

    Attributes
    ----------
    ctx : moderngl.Context
    on_picture : callable
        Called when a picture is asked for.

    Raises
    ------
    GpuError
        No display, or no OpenGL 3.3 on it.
    """

    def __init__(self, title: str, size: tuple[int, int], catch_mouse: bool = True):
        logging.getLogger("moderngl_window").setLevel(logging.ERROR)
        try:
            import moderngl_window

            window_class: Any = moderngl_window.get_local_window_cls("pyglet")
            self._window = window_class(title=title, size=size, gl_version=(3, 3), vsync=True, resizable=True)
        except Exception as problem:
            # pyglet's own errors differ from system to system, and may come as early as at import.
            reason = str(problem).strip() or type(problem).__name__
            raise GpuError("window", f"cannot be opened ({reason}); expected a display, or --headless") from problem
        self.ctx: moderngl.Context = self._window.ctx
        self.on_picture: Callable[[], None] = lambda: None
        self._window.exit_key = None  # it would close the window, and its context, before the last picture is kept
        self._quits = False
        self._actions = {getattr(self._window.keys, name): key.action for name, key in KEYS.items()}
        self._walk: Walk | None = None
        self._buttons: set[int] = set()
        self._drags_divider = False
        window = self._window
        window.key_event_func = self._key
        window.mouse_position_event_func = window.mouse_drag_event_func = self._mouse_moved
        window.mouse_press_event_func, window.mouse_release_event_func = self._mouse_pressed, self._mouse_released
        window.mouse_scroll_event_func = self._wheel
        # Keys that are down when another window comes forward are released unseen; only pyglet tells when that is.
        window._window.push_handlers(on_deactivate=self._let_all_go)
        self._catch_mouse(catch_mouse)

    @property
    def pixel_ratio(self) -> float:
        """Pixels of the picture for one of the window's own."""
        return self._window.pixel_ratio

    @property
    def picture_size(self) -> tuple[int, int]:
        """Pixels."""
        return self._window.buffer_size

    def announce(self, text: str, font_size: int) -> None:
        """Show a line in the empty window, while there is nothing else to see."""
        overlay = Overlay(self.ctx)
        self._window.use()
        self._window.clear(0.05, 0.06, 0.08, 1.0)
        overlay.draw_panels(self.picture_size, [Panel((text,), (0.5, 0.5))], font_size)
        self._window.swap_buffers()
        overlay.release()

    def run(self, walk: Walk, frames: int | None = None, step: float | None = None) -> None:
        """Show a walk until the window is closed.

        Parameters
        ----------
        walk : Walk
            In this window's context.
        frames : int, optional
            Close after so many pictures.
        step : float, optional
            Seconds from picture to picture; as much as really passes if left out.
        """
        self._walk = walk
        last, shown = time.perf_counter(), 0
        try:
            while not (self._quits or self._window.is_closing) and (frames is None or shown < frames):
                now = time.perf_counter()
                if shown:
                    walk.step(min(now - last, LONGEST_STEP) if step is None else step)
                last = now
                walk.resize(self.picture_size)
                walk.draw()
                self._window.use()
                self._window.fbo.viewport = (0, 0, *self.picture_size)
                walk.present()
                self._window.swap_buffers()
                shown += 1
        finally:
            self._walk = None

    def close(self) -> None:
        """Let the mouse go and close the window."""
        self._catch_mouse(False)
        self._window.close()

    def _catch_mouse(self, caught: bool) -> None:
        if self._window.mouse_exclusivity != caught:
            self._window.mouse_exclusivity = caught

    def _key(self, key: Any, action: Any, modifiers: Any) -> None:
        walk, meant = self._walk, self._actions.get(key)
        if walk is None or meant is None:
            return
        if action == self._window.keys.ACTION_RELEASE:
            walk.let_go(meant)
        elif meant == "mouse":
            self._catch_mouse(not self._window.mouse_exclusivity)
        elif meant == "quit":
            self._quits = True
        elif meant == "picture":
            self.on_picture()
        elif meant not in WINDOW:
            walk.press(meant)

    def _let_all_go(self) -> None:
        self._buttons.clear()
        self._drags_divider = False
        if self._walk is not None:
            self._walk.held.clear()

    def _mouse_moved(self, x: int, y: int, dx: int, dy: int) -> None:
        walk = self._walk
        if walk is None:
            return
        if RIGHT in self._buttons:
            walk.drag_sun(dx, dy)
        elif self._drags_divider:
            walk.move_divider(dx * self.pixel_ratio)
        elif self._window.mouse_exclusivity or LEFT in self._buttons:
            walk.look(dx, dy)

    def _mouse_pressed(self, x: int, y: int, button: int) -> None:
        self._buttons.add(button)
        if button == LEFT and self._walk is not None and self._walk.shown.split is not None:
            caught = self._window.mouse_exclusivity
            self._drags_divider = caught or abs(x * self.pixel_ratio - self._walk.divider) <= GRAB * self.pixel_ratio

    def _mouse_released(self, x: int, y: int, button: int) -> None:
        self._buttons.discard(button)
        self._drags_divider &= button != LEFT

    def _wheel(self, across: float, up: float) -> None:
        if self._walk is not None:
            self._walk.walker.faster(up)
