"""What the keys and the mouse do in a walk: one table for the window, the help and the manual."""

from __future__ import annotations

from typing import NamedTuple

from runtime.walk.walker import MOVES, TURNS


class Key(NamedTuple):
    """What a key does, and under which label the help says so, together with the keys that follow without one."""

    action: str
    label: str = ""
    help: str = ""


KEYS = {
    "W": Key("forward", "W A S D", "walk"),
    "A": Key("left"),
    "S": Key("back"),
    "D": Key("right"),
    "LEFT_SHIFT": Key("sprint", "Shift", "four times as fast"),
    "LEFT": Key("turn left", "arrows", "look around"),
    "RIGHT": Key("turn right"),
    "UP": Key("turn up"),
    "DOWN": Key("turn down"),
    "F": Key("fly", "F", "fly, or walk on the ground"),
    "Q": Key("down", "Q E", "down, up, while flying"),
    "E": Key("up"),
    "R": Key("return", "R", "back to the scene's camera"),
    "C": Key("path", "C", "along the scene's camera path"),
    "T": Key("time", "T", "let the time of day go on, or stand still"),
    "COMMA": Key("earlier", ", .", "earlier, later"),
    "PERIOD": Key("later"),
    "NUMBER_1": Key("lit", "1 2 3 4 5 6", "lit, albedo, normals, depth, overdraw, codes"),
    "NUMBER_2": Key("albedo"),
    "NUMBER_3": Key("normals"),
    "NUMBER_4": Key("depth"),
    "NUMBER_5": Key("overdraw"),
    "NUMBER_6": Key("codes"),
    "N": Key("dither", "N", "the normals' dither seen, or filtered"),
    "O": Key("shadows", "O", "shadows on, off"),
    "M": Key("split", "M", "meshes left of a divider, impostors right"),
    "P": Key("picture", "P", "write the picture as a PNG"),
    "I": Key("statistics", "I", "statistics on, off"),
    "H": Key("help", "H", "help on, off"),
    "TAB": Key("mouse", "Tab", "set the mouse free, or catch it again"),
    "F11": Key("fullscreen", "F11", "full screen on, off"),
    "ESCAPE": Key("quit", "Escape", "quit"),
}
"""By the names that moderngl-window gives them."""
MOUSE = (
    ("mouse", "look around; set free, with the left button held"),
    ("right button", "drag the sun"),
    ("left button", "drag the divider of the split screen"),
    ("wheel", "walk faster, slower"),
)
HELP = (*((key.label, key.help) for key in KEYS.values() if key.label), *MOUSE)
HELD = frozenset({*MOVES, *TURNS, "earlier", "later"})
"""Actions that last as long as their key is down."""
WINDOW = frozenset({"picture", "mouse", "fullscreen", "quit"})
"""Actions that the window sees to."""
