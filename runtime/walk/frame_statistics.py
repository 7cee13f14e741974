"""What a walk's pictures cost."""

from __future__ import annotations

from collections import deque
from statistics import median
from typing import Any

RECENT = 60  # pictures


class FrameStatistics:
    """Times and counts of the pictures of a walk.

    Attributes
    ----------
    frames : int
        Pictures so far.
    latest : dict of int
        Of the last picture: its `draw_calls`, and what `ImpostorRenderer.statistics` says.
    """

    def __init__(self):
        self.frames = 0
        self.latest: dict[str, int] = {}
        self._seconds: list[float] = []
        self._recent: deque[float] = deque(maxlen=RECENT)
        self._relit = 0

    def add(self, seconds: float, draw_calls: int, renderer: dict[str, int]) -> None:
        """Note one picture: how long it took to draw, and what that took."""
        self.frames += 1
        self._seconds.append(seconds)
        self._recent.append(seconds)
        self._relit += renderer.get("relit", 0)
        self.latest = {"draw_calls": draw_calls, **renderer}

    def rows(self) -> list[tuple[str, str]]:
        """For people, of the last pictures."""
        if not self._recent:
            return []
        milliseconds, now = 1000 * median(self._recent), self.latest
        copies = f"{now['instances']:,} as impostors, {now['meshes']:,} as meshes"
        return [
            ("frame", f"{milliseconds:.1f} ms"),
            ("draw calls", f"{now['draw_calls']:,}"),
            ("copies seen", copies),
            ("tiles relit", f"{now['relit']:,} of {now['tiles']:,}"),
        ]

    def summary(self) -> dict[str, Any]:
        """For programs, of all pictures: the median time to draw one, and the counts of the last."""
        names = ("instances", "meshes", "triangles", "tiles")
        return {
            "frames": self.frames,
            "frame_ms": round(1000 * median(self._seconds), 3) if self._seconds else None,
            "draw_calls": self.latest.get("draw_calls", 0),
            "tiles_relit": self._relit,
            **{name: self.latest.get(name, 0) for name in names},
        }
