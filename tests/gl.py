"""OpenGL called directly, as a caller would who does not use moderngl: read all state, or set all of it askew."""

import ctypes

LIBRARY = ctypes.CDLL("libGL.so.1")

SWITCHES = {
    "BLEND": 0x0BE2, "DEPTH_TEST": 0x0B71, "CULL_FACE": 0x0B44, "SCISSOR_TEST": 0x0C11, "STENCIL_TEST": 0x0B90,
    "POLYGON_OFFSET_FILL": 0x8037, "POLYGON_OFFSET_LINE": 0x2A02, "POLYGON_OFFSET_POINT": 0x2A01,
    "POLYGON_SMOOTH": 0x0B41, "LINE_SMOOTH": 0x0B20,
    "FRAMEBUFFER_SRGB": 0x8DB9, "RASTERIZER_DISCARD": 0x8C89, "SAMPLE_ALPHA_TO_COVERAGE": 0x809E,
    "SAMPLE_ALPHA_TO_ONE": 0x809F, "SAMPLE_COVERAGE": 0x80A0, "SAMPLE_MASK": 0x8E51, "MULTISAMPLE": 0x809D,
    "COLOR_LOGIC_OP": 0x0BF2, "DEPTH_CLAMP": 0x864F, "DITHER": 0x0BD0, "PRIMITIVE_RESTART": 0x8F9D,
    "PROGRAM_POINT_SIZE": 0x8642, "CLIP_DISTANCE0": 0x3000, "TEXTURE_CUBE_MAP_SEAMLESS": 0x884F,
}  # fmt: skip
INTEGERS = {
    "VIEWPORT": (0x0BA2, 4), "SCISSOR_BOX": (0x0C10, 4), "COLOR_WRITEMASK": (0x0C23, 4), "DEPTH_WRITEMASK": (0x0B72, 1),
    "DEPTH_FUNC": (0x0B74, 1), "BLEND_SRC_RGB": (0x80C9, 1), "BLEND_DST_RGB": (0x80C8, 1),
    "BLEND_SRC_ALPHA": (0x80CB, 1), "BLEND_DST_ALPHA": (0x80CA, 1), "BLEND_EQUATION_RGB": (0x8009, 1),
    "BLEND_EQUATION_ALPHA": (0x883D, 1), "CULL_FACE_MODE": (0x0B45, 1), "FRONT_FACE": (0x0B46, 1),
    "POLYGON_MODE": (0x0B40, 1), "LOGIC_OP_MODE": (0x0BF0, 1), "STENCIL_FUNC": (0x0B92, 1), "STENCIL_REF": (0x0B97, 1),
    "STENCIL_VALUE_MASK": (0x0B93, 1), "STENCIL_WRITEMASK": (0x0B98, 1), "STENCIL_CLEAR_VALUE": (0x0B91, 1),
    "CURRENT_PROGRAM": (0x8B8D, 1), "VERTEX_ARRAY": (0x85B5, 1), "ARRAY_BUFFER": (0x8894, 1),
    "DRAW_FRAMEBUFFER": (0x8CA6, 1), "READ_FRAMEBUFFER": (0x8CAA, 1), "RENDERBUFFER": (0x8CA7, 1),
    "UNIFORM_BUFFER": (0x8A28, 1), "PIXEL_UNPACK_BUFFER": (0x88EF, 1), "PIXEL_PACK_BUFFER": (0x88ED, 1),
    "ACTIVE_TEXTURE": (0x84E0, 1), "UNPACK_ALIGNMENT": (0x0CF5, 1), "UNPACK_ROW_LENGTH": (0x0CF2, 1),
    "UNPACK_SKIP_ROWS": (0x0CF3, 1), "UNPACK_SKIP_PIXELS": (0x0CF4, 1), "UNPACK_SWAP_BYTES": (0x0CF0, 1),
    "PACK_ALIGNMENT": (0x0D05, 1), "PACK_ROW_LENGTH": (0x0D02, 1), "PROVOKING_VERTEX": (0x8E4F, 1),
}  # fmt: skip
FLOATS = {
    "COLOR_CLEAR_VALUE": (0x0C22, 4), "DEPTH_CLEAR_VALUE": (0x0B73, 1), "DEPTH_RANGE": (0x0B70, 2),
    "BLEND_COLOR": (0x8005, 4), "POLYGON_OFFSET_FACTOR": (0x8038, 1), "POLYGON_OFFSET_UNITS": (0x2A00, 1),
    "LINE_WIDTH": (0x0B21, 1),
}  # fmt: skip
TEXTURE0, TEXTURE_2D, TEXTURE_BINDING_2D, SAMPLER_BINDING, MOST_UNITS = 0x84C0, 0x0DE1, 0x8069, 0x8919, 0x8872


def gl(name, *arguments):
    """Call an OpenGL function with integers, floats and ctypes values."""
    converted = [ctypes.c_float(value) if isinstance(value, float) else value for value in arguments]
    return getattr(LIBRARY, name)(*converted)


def made(kind):
    """A new name, as `glGenTextures` gives."""
    name = ctypes.c_uint()
    gl(f"glGen{kind}", 1, ctypes.byref(name))
    return name.value


def deleted(kind, *names):
    """Delete what `made` made."""
    gl(f"glDelete{kind}", len(names), (ctypes.c_uint * len(names))(*names))


def integers(name, count=1):
    values = (ctypes.c_int * 16)()
    gl("glGetIntegerv", name, values)
    return tuple(values[:count])


def snapshot():
    """Everything a pass could change: a dict by name."""
    state = {name: gl("glIsEnabled", switch) & 0xFF for name, switch in SWITCHES.items()}
    state |= {name: integers(*what) for name, what in INTEGERS.items()}
    values = (ctypes.c_float * 16)()
    for name, (number, count) in FLOATS.items():
        gl("glGetFloatv", number, values)
        state[name] = tuple(values[:count])
    active = integers(0x84E0)[0]
    for unit in range(integers(MOST_UNITS)[0]):
        gl("glActiveTexture", TEXTURE0 + unit)
        state[f"unit {unit}"] = integers(TEXTURE_BINDING_2D) + integers(SAMPLER_BINDING)
    gl("glActiveTexture", active)
    return state


def set_askew(textures, sampler):
    """Set whatever would spoil a pass that relied on the default; framebuffer and viewport stay as they are."""
    for name in ("CULL_FACE", "STENCIL_TEST", "POLYGON_OFFSET_FILL", "FRAMEBUFFER_SRGB", "COLOR_LOGIC_OP"):
        gl("glEnable", SWITCHES[name])
    for name in ("POLYGON_OFFSET_LINE", "POLYGON_OFFSET_POINT"):
        gl("glEnable", SWITCHES[name])
    for name in ("RASTERIZER_DISCARD", "SAMPLE_ALPHA_TO_COVERAGE", "DEPTH_CLAMP", "BLEND"):
        gl("glEnable", SWITCHES[name])
    gl("glDisable", SWITCHES["DEPTH_TEST"])
    gl("glDepthMask", 0)
    gl("glDepthFunc", 0x0200)  # NEVER
    gl("glBlendFuncSeparate", 0, 0, 1, 1)
    gl("glBlendEquationSeparate", 0x8007, 0x800B)  # MIN, REVERSE_SUBTRACT
    gl("glCullFace", 0x0408)  # FRONT_AND_BACK
    gl("glFrontFace", 0x0900)  # CW
    gl("glPolygonOffset", 3.0, 700.0)
    gl("glPolygonMode", 0x0408, 0x1B01)  # LINE
    gl("glLogicOp", 0x150A)  # INVERT
    gl("glStencilFunc", 0x0200, 1, 255)  # NEVER
    gl("glClearColor", 0.1, 0.2, 0.3, 0.4)
    gl("glClearDepth", ctypes.c_double(0.25))
    gl("glBlendColor", 0.5, 0.5, 0.5, 0.5)
    gl("glPixelStorei", 0x0CF5, 8)  # UNPACK_ALIGNMENT
    gl("glPixelStorei", 0x0CF2, 3)  # UNPACK_ROW_LENGTH
    gl("glPixelStorei", 0x0CF3, 1)  # UNPACK_SKIP_ROWS
    gl("glPixelStorei", 0x0CF4, 2)  # UNPACK_SKIP_PIXELS
    gl("glPixelStorei", 0x0CF0, 1)  # UNPACK_SWAP_BYTES
    gl("glPixelStorei", 0x0D05, 2)  # PACK_ALIGNMENT
    for unit in (*range(8), integers(MOST_UNITS)[0] - 1):
        gl("glActiveTexture", TEXTURE0 + unit)
        gl("glBindTexture", TEXTURE_2D, textures[unit % len(textures)])
        gl("glBindSampler", unit, sampler)
    gl("glActiveTexture", TEXTURE0 + 4)


def set_plain():
    """The state of a new context, framebuffer and viewport left as they are."""
    for name, switch in SWITCHES.items():
        gl("glEnable" if name in ("MULTISAMPLE", "DITHER", "PRIMITIVE_RESTART") else "glDisable", switch)
    gl("glDepthMask", 1)
    gl("glColorMask", 1, 1, 1, 1)
    gl("glDepthFunc", 0x0201)
    gl("glBlendFunc", 1, 0)
    gl("glBlendEquation", 0x8006)
    gl("glCullFace", 0x0405)
    gl("glFrontFace", 0x0901)
    gl("glPolygonOffset", 0.0, 0.0)
    gl("glPolygonMode", 0x0408, 0x1B02)
    gl("glLogicOp", 0x1503)
    gl("glStencilFunc", 0x0207, 0, 255)
    gl("glClearColor", 0.0, 0.0, 0.0, 0.0)
    gl("glClearDepth", ctypes.c_double(1))
    for name, value in ((0x0CF5, 4), (0x0CF2, 0), (0x0CF3, 0), (0x0CF4, 0), (0x0CF0, 0), (0x0D05, 4)):
        gl("glPixelStorei", name, value)
    for unit in range(integers(MOST_UNITS)[0]):
        gl("glActiveTexture", TEXTURE0 + unit)
        gl("glBindTexture", TEXTURE_2D, 0)
        gl("glBindSampler", unit, 0)
    gl("glActiveTexture", TEXTURE0)
    gl("glUseProgram", 0)
    gl("glBindVertexArray", 0)
    gl("glBindBuffer", 0x8892, 0)
    gl("glBindBuffer", 0x88EC, 0)
    gl("glBindBuffer", 0x88EB, 0)
