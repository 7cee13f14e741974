"""Programs: shader files compiled, and the uniforms they are given."""

from __future__ import annotations

import re
from pathlib import Path

import moderngl
import numpy as np

from impostor.errors import GpuError

SHADERS = Path(__file__).parents[1] / "shaders"


def load_program(ctx: moderngl.Context, vertex: str, fragment: str) -> moderngl.Program:
    """Compile a pair of shader files from `runtime/shaders`.

    `#include "name"` lines are replaced by the file `shaders/include/name`; an include does not include.

    Raises
    ------
    GpuError
        The files do not compile or link; the message ends with the source, its lines numbered.
    """
    sources = [_with_includes(name) for name in (vertex, fragment)]
    try:
        return ctx.program(vertex_shader=sources[0], fragment_shader=sources[1])
    except moderngl.Error as problem:
        listing = "".join(
            f"\n{name}\n" + "\n".join(f"{number:4d} {line}" for number, line in enumerate(source.splitlines(), 1))
            for name, source in zip((vertex, fragment), sources, strict=True)
        )
        error = GpuError(f"{vertex}, {fragment}", f"does not compile: {problem}")
        error.add_note(listing)
        raise error from problem


def _with_includes(name: str) -> str:
    def included(match: re.Match[str]) -> str:
        return (SHADERS / "include" / match[1]).read_text()

    return re.sub(r'^#include "([^"]+)"$', included, (SHADERS / name).read_text(), flags=re.MULTILINE)


def set_uniforms(program: moderngl.Program, **values: object) -> None:
    """Give a program its uniforms; matrices as (n, n) arrays in reading order, samplers as their unit.

    Raises
    ------
    GpuError
        The program has no such uniform.
    """
    for name, value in values.items():
        try:
            uniform = program[name]
        except KeyError:
            raise GpuError("shader", f"no uniform {name!r}; expected one of {', '.join(program)}") from None
        if not isinstance(uniform, moderngl.Uniform):
            raise GpuError("shader", f"{name!r} is a {type(uniform).__name__}; expected a uniform")
        if isinstance(value, np.ndarray) and value.ndim == 2 and value.shape[0] == value.shape[1]:
            uniform.write(np.ascontiguousarray(value.T, "f4"))
        elif isinstance(value, np.ndarray):
            uniform.write(np.ascontiguousarray(value, "f4"))
        else:
            uniform.value = value
