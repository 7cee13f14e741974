"""What names a file. Without NumPy: commands check their outputs before they import anything heavy."""

from __future__ import annotations

from os import PathLike

from impostor.errors import SettingsError


def check_path(path: object) -> None:
    """Refuse what names no file: Python would take a whole number for one that is open already.

    Raises
    ------
    SettingsError
    """
    if not isinstance(path, str | PathLike):
        raise SettingsError("path", f"a {type(path).__name__}; expected a str or a path")
