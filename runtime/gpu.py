"""OpenGL contexts, programs and uploads: what every pass stands on."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.errors import GpuError
from impostor.files.fan_manifest import atlas_grid

SHADERS = Path(__file__).with_name("shaders")
EGL_PACKAGES = "libegl1 libgl1 libegl-mesa0 libgl1-mesa-dri"
SRGB8_ALPHA8 = 0x8C43


def make_context() -> moderngl.Context:
    """A context without a window: EGL where there is one, the platform's own otherwise.

    Raises
    ------
    GpuError
        No OpenGL 3.3 to be had; the message says what to install.
    """
    problems = []
    egl: dict[str, Any] = {"backend": "egl", "libgl": "libGL.so.1", "libegl": "libEGL.so.1"}
    for options in (egl, {}):
        try:
            context = moderngl.create_context(require=330, standalone=True, **options)
        except Exception as problem:
            problems.append(str(problem).strip() or type(problem).__name__)
        else:
            return context
    reasons = "; ".join(problems)
    raise GpuError("OpenGL", f"no context of version 3.3 ({reasons}); on Debian or Ubuntu install {EGL_PACKAGES}")


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


class InstanceBuffer:
    """A vertex buffer of per-instance records that grows as needed."""

    def __init__(self, ctx: moderngl.Context, dtype: np.dtype, count: int = 64):
        self.buffer = ctx.buffer(reserve=dtype.itemsize * count, dynamic=True)

    def write(self, records: NDArray[Any]) -> None:
        """Upload the records; the buffer's old contents are given up, so the GPU need not wait."""
        self.buffer.orphan(max(records.nbytes, self.buffer.size))
        self.buffer.write(records)

    def release(self) -> None:
        """Free the buffer."""
        self.buffer.release()


def check_texture_size(ctx: moderngl.Context, what: str, width: int, height: int) -> None:
    """Refuse an image that the GPU cannot hold.

    Raises
    ------
    GpuError
    """
    limit = ctx.info["GL_MAX_TEXTURE_SIZE"]
    if max(width, height) > limit:
        raise GpuError(what, f"needs a texture of {width}x{height}; this GPU holds at most {limit}x{limit}")


def tiles_to_atlas(tiles: NDArray[np.generic]) -> NDArray[np.generic]:
    """Lay tiles (V, S, S, ...) out in one image, near-square, row by row; missing tiles are zero."""
    count, size = tiles.shape[:2]
    columns, rows = atlas_grid(count)
    atlas = np.zeros((rows, size, columns, size, *tiles.shape[3:]), tiles.dtype)
    for row in range(rows):
        part = tiles[row * columns : (row + 1) * columns]
        atlas[row, :, : len(part)] = part.swapaxes(0, 1)
    return atlas.reshape(rows * size, columns * size, *tiles.shape[3:])
