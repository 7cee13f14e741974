"""Contact shadows, as a caller sets them: how dark the ground gets around the feet of what stands on it."""

from __future__ import annotations

from dataclasses import dataclass

from runtime.checks import check_number


@dataclass(frozen=True)
class ContactShadows:
    """How dark the ground gets around the feet of what stands on it.

    What stands near a place keeps light from it that comes from all around: ambient light and that of rooms, but for
    the lights that cast shadows of their own.

    Parameters
    ----------
    strength : float
        0 to 1: the part of that light that is gone right under an object.
    reach : float
        Up to which part of an object's height it counts: with 0.25 a tree has a dark foot, with 1 a whole crown darkens
        the ground under it. The darkening fades with the height and reaches twice as far to the side.

    Raises
    ------
    SettingsError
        A number outside its range.
    """

    strength: float = 1.0
    reach: float = 0.25

    def __post_init__(self):
        check_number("contact shadows", "strength", self.strength, 0, 1)
        check_number("contact shadows", "reach", self.reach, 0, 1, above=True)
