"""What commands share: their flags, a bar for long work, and how what they found is printed."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from impostor.errors import OutputError, SettingsError
from impostor.files.output import check_output
from impostor.stopping import check_stopped


def _known_axis(axis: str | None) -> str | None:
    if axis not in (None, "y", "z"):
        raise SettingsError("--up", f"{axis!r}; expected y or z")
    return axis


Force = Annotated[bool, typer.Option("--force", help="Replace the output if it exists.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="No progress bar and no summary.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
UpAxis = Annotated[
    str | None, typer.Option("--up", metavar="y|z", help="The model file's up axis; y.", callback=_known_axis)
]
BakedUpAxis = Annotated[
    str | None, typer.Option("--up", metavar="y|z", help="As the fan was baked if left out.", callback=_known_axis)
]
AllowMissing = Annotated[
    bool, typer.Option("--allow-missing-textures", help="Draw the base colour where a texture's file is missing.")
]


def print_summary(summary: dict[str, Any], as_json: bool) -> None:
    """Print a mapping as JSON, or as one aligned line an entry."""
    if as_json:
        print(json.dumps(summary, indent=2))
        return
    width = max(map(len, summary))
    for key, value in summary.items():
        print(f"{key.replace('_', ' '):{width}}  {_in_words(value)}")


def _in_words(value: Any) -> str:
    if isinstance(value, dict):
        value = [f"{key} {_in_words(part)}" for key, part in value.items() if part is not None]
    if isinstance(value, list):
        return ", ".join(" to ".join(map(str, part)) if isinstance(part, list) else str(part) for part in value) or "-"
    return "-" if value is None else str(value)


def check_name(path: Path, suffix: str, force: bool) -> None:
    """Refuse an output that cannot be written, or whose name would say that it is something else."""
    if path.suffix.lower() != suffix:
        raise OutputError(path, f"ends in {path.suffix!r}; expected a name that ends in {suffix!r}")
    check_output(path, force)


def refuse_with_fan(fan: Path, **flags: object) -> None:
    """Refuse flags that say how a model file is read, where a fan is given that was made of one long ago."""
    for name, value in flags.items():
        if value:
            raise SettingsError(_flag(name), f"given with {fan}; expected it with a model, not with a fan")


@contextmanager
def as_flags(*names: str, **flags: str) -> Iterator[None]:
    """Say of a flag what a function says of the parameter that it became.

    Parameters
    ----------
    *names : str
        Parameters that are called as their flags.
    **flags : str
        The flags of others.
    """
    try:
        yield
    except SettingsError as error:
        if error.where not in (*names, *flags):
            raise
        raise SettingsError(flags.get(error.where) or _flag(error.where), error.problem) from error


def _flag(parameter: str) -> str:
    return "--" + parameter.replace("_", "-")


@contextmanager
def progress_bar(label: str, quiet: bool = False) -> Iterator[Callable[[int, int], None]]:
    """A function to call with steps done and steps in all, which draws a bar on standard error.

    Silent when told so, and where standard error is not a terminal. A command can be stopped at every step.
    """
    if quiet or not sys.stderr.isatty():
        yield lambda done, total: check_stopped()
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=None)

        def step(done: int, total: int) -> None:
            check_stopped()
            bar.update(task, completed=done, total=total)

        yield step
