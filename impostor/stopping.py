"""Ctrl-C, and the `kill` of a shell or a scheduler: both end a command tidily, whoever is at work when they come."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

INTERRUPTED = 130  # the exit code that Typer, and every shell, makes of Ctrl-C
_signals: list[int] = []  # of the command that runs


@contextmanager
def stoppable() -> Iterator[list[int]]:
    """Raise KeyboardInterrupt for SIGTERM as for SIGINT, and remember the signals that came.

    A library may make an error of its own of what is raised within it, as ctypes does, and PyOpenGL with it; the list
    tells that a signal was the reason.

    Yields
    ------
    list of int
        Numbers of the signals that have come. Always empty outside the main thread, which alone gets signals; a signal
        that is ignored, as under nohup, stays so, and a caller's own handler stays in force.
    """
    global _signals
    come: list[int] = []
    _signals, outer = come, _signals

    def stop(number: int, frame: FrameType | None) -> None:
        come.append(number)
        raise KeyboardInterrupt

    before = {}
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
                before[number] = signal.signal(number, stop)
    try:
        yield come
    finally:
        _signals = outer
        for number, handler in before.items():
            signal.signal(number, handler)


def check_stopped() -> None:
    """Raise KeyboardInterrupt again if a library has swallowed it, as those do that catch all that an import raises."""
    if _signals:
        raise KeyboardInterrupt
