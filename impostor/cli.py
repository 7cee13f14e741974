"""The `impostor` command: assembles the stages' commands, and turns every problem into one line."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import entry_points
from pathlib import Path
from typing import Annotated, Any

import typer

from impostor.commands import AsJson, Force, UpAxis, check_name, print_summary, refuse_with_fan
from impostor.errors import ImpostorError, ImpostorWarning, SettingsError
from impostor.stopping import INTERRUPTED, stoppable

EPILOG = "Exit codes: 0 done, 1 failed, 2 wrong usage. Angles are in degrees, azimuth from +Z toward +X."


def main(arguments: list[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    arguments : list of str, optional
        What follows the program's name; the process's own if not given.

    Returns
    -------
    int
        The exit code.
    """
    with stoppable() as signals:
        try:
            code, lines = _outcome(sys.argv[1:] if arguments is None else arguments)
        except Exception:
            if not signals:
                raise
            code, lines = 1, []
    if code and signals:
        code, lines = 128 + signals[0], ["stopped"]
    for line in lines:
        print(f"impostor: {line}", file=sys.stderr)
    return code


def _outcome(arguments: list[str]) -> tuple[int, list[str]]:
    """The exit code of one command, and what is to be said on standard error at its end."""
    notices: list[str] = []
    try:
        command = typer.main.get_command(make_app())
        with _held_warnings(notices):
            code = command.main(arguments or ["--help"], "impostor", standalone_mode=False) or 0
        return code, ["stopped"] if code == INTERRUPTED else [f"warning: {notice}" for notice in notices]
    except SettingsError as error:
        return 2, [str(error)]
    except ImpostorError as error:
        return 1, [str(error)]
    except typer.TyperException as error:
        return 2, [_usage_problem(error)]
    except (KeyboardInterrupt, typer.Abort):
        return INTERRUPTED, ["stopped"]
    except MemoryError:
        return 1, ["not enough memory; smaller or fewer pictures take less"]
    except BrokenPipeError:
        sys.stderr.close()  # whoever read our output has gone
        return 1, []
    except OSError as error:
        return 1, [f"{error.filename or 'system'}: {error.strerror or error}; expected a file that can be used"]


def make_app() -> typer.Typer:
    """Every command of every installed stage."""
    app = typer.Typer(
        add_completion=False,
        rich_markup_mode=None,
        epilog=EPILOG,
        pretty_exceptions_enable=False,
        help="Bake any mesh into a fan of small images; draw it as one quad, relight it live, cast its shadow.",
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    stages = sorted(entry_points(group="impostor.commands"), key=lambda stage: stage.name)
    for stage in stages:
        stage.load()(app)
    app.command("info")(info)
    app.command("validate")(validate)
    app.add_typer(_ptm_app())
    app.add_typer(_environment_app())
    return app


def _ptm_app() -> typer.Typer:
    from impostor import ptm_cli

    ptm = typer.Typer(name="ptm", help="Polynomial texture maps: fit, draw, convert and measure them.")
    for stage in sorted(entry_points(group="impostor.ptm_commands"), key=lambda stage: stage.name):
        stage.load()(ptm)
    ptm_cli.register(ptm)
    return ptm


def _environment_app() -> typer.Typer:
    from impostor import environment_cli

    environment = typer.Typer(name="environment", help="Environment maps: describe and convert them.")
    environment_cli.register(environment)
    return environment


def info(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A .fan, a .ptm, or a model.")],
    as_json: AsJson = False,
    picture: Annotated[Path | None, typer.Option(help="Write the layers of eight views as a PNG.")] = None,
    up: UpAxis = None,
    force: Force = False,
) -> None:
    """Say what is in a fan, a PTM or a model."""
    if file.suffix.lower() == ".fan":
        refuse_with_fan(file, up=up)
        from impostor.summary import fan_summary

        summary = fan_summary(file)
        if picture is not None:
            from impostor.files.fan_file import read_fan
            from impostor.summary import write_contact_sheet

            check_name(picture, ".png", force)
            write_contact_sheet(read_fan(file), picture, force)
    elif picture is not None:
        raise SettingsError("--picture", f"{file} has no views; expected a .fan")
    elif file.suffix.lower() == ".ptm":
        from impostor.summary import ptm_summary

        if up is not None:
            raise SettingsError("--up", f"given with {file}; expected it with a model")
        summary = ptm_summary(file)
    elif file.suffix.lower() in (".hdr", ".exr"):
        raise SettingsError(str(file), "is an environment map; expected `impostor environment info` for it")
    else:
        from impostor.summary import model_summary

        summary = model_summary(file, up or "y")
    print_summary(summary, as_json)


def validate(files: Annotated[list[Path], typer.Argument(metavar="FILE...", help=".fan and .ptm files.")]) -> None:
    """Check everything that must hold in fans and PTMs; prints a line for each problem."""
    from impostor.files.fan_file import validate_fan
    from impostor.files.ptm_file import validate_ptm

    problems = 0
    for file in files:
        found = validate_ptm(file) if file.suffix.lower() == ".ptm" else validate_fan(file)
        problems += len(found)
        for line in found:
            print(line, file=sys.stderr)
        if not found:
            print(f"{file}: sound")
    if problems:
        raise typer.Exit(1)


@contextmanager
def _held_warnings(notices: list[str]) -> Iterator[None]:
    """Gather what the user may not expect: it is said at the end, and a failed command says one line only."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.simplefilter("always", ImpostorWarning)
        warnings.showwarning = lambda message, *_, **__: notices.append(" ".join(str(message).split()))
        yield


def _usage_problem(error: typer.TyperException) -> str:
    """One line about flags and arguments, with the value that was given: Typer leaves it out."""
    message = " ".join(error.format_message().split())
    if message.startswith("Missing ") and getattr(error, "param", None) is not None:
        param = error.param  # type: ignore[attr-defined]
        name = param.opts[0] if param.param_type_name == "option" else param.metavar
        message = f"{name}: missing; expected one"
    if isinstance(error, typer.BadParameter) and error.param is not None and hasattr(error.__cause__, "errors"):
        problem: dict[str, Any] = error.__cause__.errors()[0]  # type: ignore[union-attr]
        expected = problem["msg"].removeprefix("Input should be ").partition(",")[0]
        message = f"{error.param.opts[0]}: {problem['input']!r}; expected {expected}"
    context = getattr(error, "ctx", None)
    return f"{message} (see {context.command_path if context else 'impostor'} --help)"
