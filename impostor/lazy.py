"""Public names that are imported when they are first asked for: whoever needs few of them waits for few."""

from __future__ import annotations

import sys
from importlib import import_module

TYPE_CHECKING = False  # see `impostor/__init__.py`
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any


def lazy_names(package: str, homes: dict[str, str]) -> Callable[[str], Any]:
    """A package's `__getattr__`.

    Parameters
    ----------
    package : str
        Its `__name__`.
    homes : dict of str to str
        The module of each name inside the package, with `:other` at the end where the name is another there.
    """

    def find(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, _, name_there = homes[name].partition(":")
        value = getattr(import_module(f"{package}.{module}"), name_there or name)
        setattr(sys.modules[package], name, value)
        return value

    return find
