"""How fans are drawn, as a caller sets it on a renderer."""

from __future__ import annotations

from runtime.checks import check_number
from runtime.fans.impostor_pass import ImpostorPass


class FanSettings:
    """Settings of the pass that draws fans, each checked when it is set."""

    _impostors: ImpostorPass

    @property
    def filtered(self) -> bool:
        return self._impostors.filtered

    @filtered.setter
    def filtered(self, filtered: bool) -> None:
        self._impostors.filtered = bool(filtered)

    @property
    def view_fade_seconds(self) -> float:
        return self._impostors.view_fade_seconds

    @view_fade_seconds.setter
    def view_fade_seconds(self, seconds: float) -> None:
        check_number("view_fade_seconds", "time", seconds, 0, 1e9)
        self._impostors.view_fade_seconds = float(seconds)
