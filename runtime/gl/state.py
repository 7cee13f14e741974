"""The caller's OpenGL state: read before a pass, put back after it.

moderngl sets state but cannot read it, so the few query functions are called directly, through the library that the
context itself came from.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import moderngl

from impostor.errors import GpuError

UNITS = 6  # texture units that the passes bind, from 0

_BLEND, _DEPTH_TEST, _CULL_FACE, _SCISSOR_TEST, _STENCIL_TEST = 0x0BE2, 0x0B71, 0x0B44, 0x0C11, 0x0B90
_POLYGON_OFFSET_FILL, _POLYGON_OFFSET_LINE, _POLYGON_OFFSET_POINT = 0x8037, 0x2A02, 0x2A01
_FRAMEBUFFER_SRGB, _RASTERIZER_DISCARD = 0x8DB9, 0x8C89
_SAMPLE_ALPHA_TO_COVERAGE, _COLOR_LOGIC_OP, _DEPTH_CLAMP, _PROGRAM_POINT_SIZE = 0x809E, 0x0BF2, 0x864F, 0x8642
_SWITCHES = (
    _BLEND,
    _DEPTH_TEST,
    _CULL_FACE,
    _SCISSOR_TEST,
    _STENCIL_TEST,
    _POLYGON_OFFSET_FILL,
    _POLYGON_OFFSET_LINE,
    _POLYGON_OFFSET_POINT,
    _FRAMEBUFFER_SRGB,
    _RASTERIZER_DISCARD,
    _SAMPLE_ALPHA_TO_COVERAGE,
    _COLOR_LOGIC_OP,
    _DEPTH_CLAMP,
    _PROGRAM_POINT_SIZE,
)
_VIEWPORT, _SCISSOR_BOX, _COLOR_WRITEMASK, _DEPTH_WRITEMASK, _DEPTH_FUNC = 0x0BA2, 0x0C10, 0x0C23, 0x0B72, 0x0B74
_BLEND_SRC_RGB, _BLEND_DST_RGB, _BLEND_SRC_ALPHA, _BLEND_DST_ALPHA = 0x80C9, 0x80C8, 0x80CB, 0x80CA
_BLEND_EQUATION_RGB, _BLEND_EQUATION_ALPHA = 0x8009, 0x883D
_POLYGON_OFFSET_FACTOR, _POLYGON_OFFSET_UNITS, _POLYGON_MODE, _FRONT_AND_BACK = 0x8038, 0x2A00, 0x0B40, 0x0408
_CURRENT_PROGRAM, _VERTEX_ARRAY, _DRAW_FRAMEBUFFER, _READ_FRAMEBUFFER = 0x8B8D, 0x85B5, 0x8CA6, 0x8CAA
_ACTIVE_TEXTURE, _TEXTURE0, _TEXTURE_2D, _TEXTURE_BINDING_2D, _SAMPLER_BINDING = 0x84E0, 0x84C0, 0x0DE1, 0x8069, 0x8919
_DRAW_TARGET, _READ_TARGET, _COLOR_ATTACHMENT0 = 0x8CA9, 0x8CA8, 0x8CE0
_FILL, _CULL_FACE_MODE, _FRONT_FACE = 0x1B02, 0x0B45, 0x0B46
_LOGIC_OP_MODE, _OR = 0x0BF0, 0x1507
_ARRAY_BUFFER, _ARRAY_BUFFER_BINDING, _UNPACK_BUFFER, _UNPACK_BUFFER_BINDING = 0x8892, 0x8894, 0x88EC, 0x88EF
# How uploads read memory: row length, skipped rows and pixels, swapped bytes; the alignments follow each upload.
_PIXEL_STORE = {0x0CF2: 0, 0x0CF3: 0, 0x0CF4: 0, 0x0CF0: 0, 0x0CF5: 4, 0x0D05: 4}

_FOUR_INTEGERS = ctypes.c_int * 4


@cache
def _library() -> Any:
    names = {
        "win32": ["opengl32.dll"],
        "darwin": ["/System/Library/Frameworks/OpenGL.framework/OpenGL"],
    }.get(sys.platform, ["libGL.so.1", "libOpenGL.so.0", "libGL.so"])
    for name in names:
        try:
            return ctypes.CDLL(name) if sys.platform != "win32" else ctypes.WinDLL(name)  # type: ignore[attr-defined]
        except OSError:
            continue
    raise GpuError("OpenGL", f"no library to load; expected one of {', '.join(names)}")


@cache
def _function(name: str) -> Any:
    library = _library()
    try:
        return getattr(library, name)
    except AttributeError:
        # Windows exports OpenGL 1.1 only; the rest comes from the current context.
        library.wglGetProcAddress.restype = ctypes.c_void_p
        address = library.wglGetProcAddress(name.encode())
        if not address:
            raise GpuError("OpenGL", f"the driver has no {name}") from None
        return ctypes.WINFUNCTYPE(None)(address)  # type: ignore[attr-defined]


def _call(name: str, *arguments: int) -> None:
    _function(name)(*arguments)


def _integers(name: int, count: int = 1) -> list[int]:
    values = _FOUR_INTEGERS()
    _function("glGetIntegerv")(name, values)
    return values[:count]


def _float(name: int) -> float:
    value = (ctypes.c_float * 4)()
    _function("glGetFloatv")(name, value)
    return value[0]


def _enabled(switch: int) -> bool:
    # A GLboolean is one byte; what ctypes takes for an int holds more.
    return bool(_function("glIsEnabled")(switch) & 0xFF)


def _polygon_offset(factor: float, units: float) -> None:
    _function("glPolygonOffset")(ctypes.c_float(factor), ctypes.c_float(units))


def _switch(name: int, on: bool) -> None:
    _call("glEnable" if on else "glDisable", name)


class CallerState:
    """What the caller had set when a pass began; the framebuffer and viewport the pass draws into."""

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        # A framebuffer that the caller has released stays here as an empty shell.
        released = ctx.fbo is None or isinstance(ctx.fbo.mglo, moderngl.InvalidObject)
        self._bound = None if released else ctx.fbo
        self._switches = {name: _enabled(name) for name in _SWITCHES}
        self.viewport = tuple(_integers(_VIEWPORT, 4))
        self._scissor = _integers(_SCISSOR_BOX, 4)
        self._color_mask = _integers(_COLOR_WRITEMASK, 4)
        self._depth_mask, self._depth_func = _integers(_DEPTH_WRITEMASK)[0], _integers(_DEPTH_FUNC)[0]
        names = (_BLEND_SRC_RGB, _BLEND_DST_RGB, _BLEND_SRC_ALPHA, _BLEND_DST_ALPHA)
        self._blend_func = [_integers(name)[0] for name in names]
        self._blend_equation = [_integers(name)[0] for name in (_BLEND_EQUATION_RGB, _BLEND_EQUATION_ALPHA)]
        self._cull_mode, self._front_face = _integers(_CULL_FACE_MODE)[0], _integers(_FRONT_FACE)[0]
        self._polygon_offset = [_float(_POLYGON_OFFSET_FACTOR), _float(_POLYGON_OFFSET_UNITS)]
        self._polygon_mode = _integers(_POLYGON_MODE, 2)[0]
        self._logic_op = _integers(_LOGIC_OP_MODE)[0]
        self._program, self._vertex_array = _integers(_CURRENT_PROGRAM)[0], _integers(_VERTEX_ARRAY)[0]
        self._draw, self._read = _integers(_DRAW_FRAMEBUFFER)[0], _integers(_READ_FRAMEBUFFER)[0]
        self._array_buffer, self._unpack_buffer = (
            _integers(name)[0] for name in (_ARRAY_BUFFER_BINDING, _UNPACK_BUFFER_BINDING)
        )
        self._pixel_store = {name: _integers(name)[0] for name in _PIXEL_STORE}
        self._active = _integers(_ACTIVE_TEXTURE)[0]
        self._textures = {}
        # moderngl makes and fills textures on the last unit.
        for unit in (*range(UNITS), ctx.max_texture_units - 1):
            _call("glActiveTexture", _TEXTURE0 + unit)
            self._textures[unit] = _integers(_TEXTURE_BINDING_2D)[0], _integers(_SAMPLER_BINDING)[0]
            _call("glBindSampler", unit, 0)
        _call("glActiveTexture", self._active)
        for name, value in _PIXEL_STORE.items():
            _call("glPixelStorei", name, value)
        _call("glBindBuffer", _UNPACK_BUFFER, 0)

    def bind_target(self) -> None:
        """Draw into the caller's framebuffer and viewport again, honouring its scissor box and colour mask."""
        if self._bound is not None:
            self._bound.use()
        _call("glBindFramebuffer", _DRAW_TARGET, self._draw)
        _call("glBindFramebuffer", _READ_TARGET, self._read)
        _call("glViewport", *self.viewport)
        _call("glScissor", *self._scissor)
        _switch(_SCISSOR_TEST, self._switches[_SCISSOR_TEST])
        _call("glColorMask", *self._color_mask)

    def restore(self) -> None:
        """Put every piece of state back."""
        self.bind_target()
        for name, on in self._switches.items():
            _switch(name, on)
        _call("glDepthMask", self._depth_mask)
        _call("glDepthFunc", self._depth_func)
        _call("glBlendFuncSeparate", *self._blend_func)
        _call("glBlendEquationSeparate", *self._blend_equation)
        _call("glCullFace", self._cull_mode)
        _call("glFrontFace", self._front_face)
        _polygon_offset(*self._polygon_offset)
        _call("glPolygonMode", _FRONT_AND_BACK, self._polygon_mode)
        _call("glLogicOp", self._logic_op)
        for unit, (texture, sampler) in self._textures.items():
            _call("glActiveTexture", _TEXTURE0 + unit)
            _call("glBindTexture", _TEXTURE_2D, texture)
            _call("glBindSampler", unit, sampler)
        _call("glActiveTexture", self._active)
        _call("glUseProgram", self._program)
        _call("glBindVertexArray", self._vertex_array)
        _call("glBindBuffer", _ARRAY_BUFFER, self._array_buffer)
        _call("glBindBuffer", _UNPACK_BUFFER, self._unpack_buffer)
        for name, value in self._pixel_store.items():
            _call("glPixelStorei", name, value)


def set_state(
    *,
    depth_test: bool = False,
    depth_write: bool = False,
    blend: tuple[int, int] | None = None,
    cull_back: bool = False,
    polygon_offset: tuple[float, float] | None = None,
    color_mask: tuple[bool, bool, bool, bool] | None = None,
    merge_bits: bool = False,
    background: bool = False,
    points: bool = False,
) -> None:
    """Set every switch that a pass relies on; what is not named is off. Depth compares with LESS.

    `background` draws what lies before the near plane or behind the far one, too, and where depth is equal.
    `merge_bits` adds the bits of whole numbers that are drawn to those that are there. `points` are as large as the
    shader says.
    """
    for name in (_STENCIL_TEST, _FRAMEBUFFER_SRGB, _RASTERIZER_DISCARD, _SAMPLE_ALPHA_TO_COVERAGE):
        _switch(name, False)
    _switch(_DEPTH_CLAMP, background)
    _switch(_PROGRAM_POINT_SIZE, points)
    _switch(_COLOR_LOGIC_OP, merge_bits)
    if merge_bits:
        _call("glLogicOp", _OR)
    _call("glPolygonMode", _FRONT_AND_BACK, _FILL)
    _switch(_DEPTH_TEST, depth_test)
    _call("glDepthFunc", 0x0203 if background else 0x0201)
    _call("glDepthMask", int(depth_write))
    _switch(_BLEND, blend is not None)
    if blend is not None:
        _call("glBlendFunc", *blend)
        _call("glBlendEquation", 0x8006)
    _switch(_CULL_FACE, cull_back)
    _call("glFrontFace", 0x0901)  # shaders ask for it, too
    if cull_back:
        _call("glCullFace", 0x0405)
    # moderngl switches all three on together, and there are drivers on which one for lines moves fills.
    for name in (_POLYGON_OFFSET_LINE, _POLYGON_OFFSET_POINT):
        _switch(name, False)
    _switch(_POLYGON_OFFSET_FILL, polygon_offset is not None)
    if polygon_offset is not None:
        _polygon_offset(*polygon_offset)
    if color_mask is not None:
        _call("glColorMask", *(int(on) for on in color_mask))


def draw_into_level(texture: moderngl.Texture, level: int) -> None:
    """Let the bound framebuffer draw into a mip level of a texture; moderngl makes framebuffers on the finest only."""
    _call("glFramebufferTexture2D", _DRAW_TARGET, _COLOR_ATTACHMENT0, _TEXTURE_2D, texture.glo, level)


def clear_color() -> None:
    """Make the bound framebuffer zero, without the caller's clear values."""
    _function("glClearBufferfv")(ctypes.c_uint(0x1800), 0, (ctypes.c_float * 4)())


def clear_bits() -> None:
    """As `clear_color`, of whole numbers."""
    _function("glClearBufferuiv")(ctypes.c_uint(0x1800), 0, (ctypes.c_uint * 4)())


@contextmanager
def preserved_state(ctx: moderngl.Context) -> Iterator[CallerState]:
    """Leave the OpenGL state as it was found, also when the body raises."""
    state = CallerState(ctx)
    try:
        yield state
    finally:
        state.restore()
