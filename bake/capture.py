"""All layers of one view of a model, by one geometry pass through pyrender."""

from __future__ import annotations

import ctypes
import os
import sys
import weakref
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from bake.resolve import CapturedView
from bake.settings import SAMPLES
from bake.vertices import vertex_records
from impostor.errors import GpuError, SettingsError
from impostor.model import Material, Model, Primitive
from impostor.views import View

INSTALL_HINT = "expected OpenGL 4.1 (Debian, Ubuntu: apt install libegl1 libgl1 libgl1-mesa-dri libegl-mesa0)"

if sys.platform.startswith("linux"):
    # PyOpenGL reads this when it is first imported, and without a display only EGL makes a context.
    os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
try:
    # pyrender's Mesh.bounds is written with np.infty, which NumPy 2 took away; nothing here asks for those bounds.
    import OpenGL.contextdata
    import OpenGL.error
    import OpenGL.GL
    import OpenGL.raw.GL.VERSION.GL_1_1 as raw_gl
    import pyrender
    from pyrender.shader_program import ShaderProgram, ShaderProgramCache

    GL: Any = OpenGL.GL
    EGL: Any = None
    if os.environ.get("PYOPENGL_PLATFORM") == "egl":
        from OpenGL import EGL
except Exception as problem:
    reason = " ".join(map(str, problem.args[:2]))
    raise GpuError("OpenGL", f"cannot be loaded ({reason}); {INSTALL_HINT}") from problem

SHADERS = Path(__file__).parent / "shaders"


class Capture:
    """Draws every layer of a model's views, each view in one geometry pass; owns an OpenGL context.

    The context is current only inside `view`: whatever context the caller uses is current again afterwards.

    Parameters
    ----------
    model : Model
    size : int
        Side of a tile in texels.
    samples : int, optional
        Samples along a texel's side: 1, 2 or 4. By default 2, or 4 for a model with textures.

    Raises
    ------
    SettingsError
        The supersampled tile is larger than the GPU can draw, or `samples` is none of the above.
    GpuError
        No OpenGL context can be made, or a shader does not compile.
    """

    def __init__(self, model: Model, size: int, samples: int | None = None):
        self.size, self.samples = size, default_samples(model) if samples is None else samples
        if self.samples not in SAMPLES:
            raise SettingsError("samples", f"{samples!r}; expected one of {', '.join(map(str, SAMPLES))}")
        self._origin = model.bounds.mean(axis=0)
        self._scene = pyrender.Scene(bg_color=np.zeros(4))
        self._scene.add(pyrender.Mesh(_primitives(model, self._origin)))
        self._camera = _Camera()
        self._camera_node = self._scene.add(self._camera)
        try:
            with _callers_context_kept():
                self._offscreen = _Offscreen(size * self.samples, size * self.samples)
        except Exception as problem:
            raise GpuError("OpenGL", f"no context ({problem or type(problem).__name__}); {INSTALL_HINT}") from problem
        self._finalizer = weakref.finalize(self, self._offscreen.delete)
        with self._offscreen.current():
            limit = min(int(GL.glGetIntegerv(name)) for name in (GL.GL_MAX_TEXTURE_SIZE, GL.GL_MAX_RENDERBUFFER_SIZE))
        if size * self.samples > limit:
            self.release()
            raise SettingsError("size", f"{size} texels of {self.samples} samples; expected at most {limit} samples")

    def view(self, view: View) -> CapturedView:
        """Every layer of one view.

        Parameters
        ----------
        view : View

        Returns
        -------
        CapturedView
        """
        self._camera.view = view
        self._scene.set_pose(self._camera_node, self._camera.pose(self._origin))
        with self._offscreen.current():
            layers: Any = self._offscreen.render(self._scene, pyrender.RenderFlags.FLAT)
        return CapturedView(view, *layers)

    def release(self):
        """Give back the context and all it holds; safe to call twice."""
        self._finalizer()

    def __enter__(self) -> Capture:
        return self

    def __exit__(self, *_):
        self.release()


def default_samples(model: Model) -> int:
    """Samples along a texel's side that a model needs: 4 where it has textures or cut-outs, else 2."""
    materials = [primitive.material for primitive in model.primitives]
    plain = (each.texture is None and each.normal_map is None and each.alpha_mode == "OPAQUE" for each in materials)
    return 2 if all(plain) else 4


def _primitives(model: Model, origin: NDArray[Any]) -> list[_Primitive]:
    textures: dict[tuple[int, tuple[bool, bool]], _Texture] = {}

    def texture(pixels: NDArray[np.uint8], clamp: tuple[bool, bool]) -> _Texture:
        return textures.setdefault((id(pixels), clamp), _Texture(pixels, clamp))

    primitives = []
    for primitive in model.primitives:
        material, pictures = primitive.material, {}
        if material.texture is not None and primitive.uvs is not None:
            pictures["base_texture"] = texture(material.texture, material.clamp)
        if material.normal_map is not None and primitive.tangents is not None:
            pictures["normal_map"] = texture(material.normal_map.picture, material.normal_map.clamp)
        primitives.append(_Primitive(primitive, _Material(material, pictures), origin))
    return primitives


class _Texture(pyrender.Texture):
    """A base-colour picture, its first row at v = 0, filtered in linear light; with three channels one of normals.

    Not anisotropic: in software that triples the time for 0.8 dB, where 4 samples instead of 2 give 8 dB.
    """

    def __init__(self, pixels: NDArray[np.uint8], clamp: tuple[bool, bool]):
        super().__init__()
        self.pixels, self._clamp = np.ascontiguousarray(pixels), clamp

    def _add_to_context(self):
        height, width = self.pixels.shape[:2]
        limit = int(GL.glGetIntegerv(GL.GL_MAX_TEXTURE_SIZE))
        if max(width, height) > limit:
            raise GpuError("texture", f"{width}x{height} texels; expected at most {limit} a side on this GPU")
        # PyOpenGL 3.1.0's own glGenTextures(1) fails from Python 3.12 on; the function under it does not.
        names = np.zeros(1, np.uint32)
        raw_gl.glGenTextures(1, names)
        self._texid = int(names[0])
        target = GL.GL_TEXTURE_2D
        GL.glBindTexture(target, self._texid)
        kind, stored = (GL.GL_RGB, GL.GL_RGB8) if self.pixels.shape[2] == 3 else (GL.GL_RGBA, GL.GL_SRGB8_ALPHA8)
        GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
        GL.glTexImage2D(target, 0, stored, width, height, 0, kind, GL.GL_UNSIGNED_BYTE, self.pixels)
        GL.glGenerateMipmap(target)
        GL.glTexParameteri(target, GL.GL_TEXTURE_MAG_FILTER, GL.GL_LINEAR)
        GL.glTexParameteri(target, GL.GL_TEXTURE_MIN_FILTER, GL.GL_LINEAR_MIPMAP_LINEAR)
        for axis, clamp in zip((GL.GL_TEXTURE_WRAP_S, GL.GL_TEXTURE_WRAP_T), self._clamp, strict=True):
            GL.glTexParameteri(target, axis, GL.GL_CLAMP_TO_EDGE if clamp else GL.GL_REPEAT)


class _Material(pyrender.Material):
    DEFINES: ClassVar = {"base_texture": "HAS_TEXTURE", "normal_map": "HAS_NORMAL_MAP"}

    def __init__(self, material: Material, pictures: dict[str, _Texture]):
        super().__init__(name=material.name, doubleSided=bool(material.double_sided))
        self.pictures = pictures
        self.uniforms: dict[str, Any] = {"base_color": material.base_color}
        self.defines = {self.DEFINES[name] for name in pictures}
        if material.normal_map is not None and "normal_map" in pictures:
            self.uniforms["normal_scale"] = material.normal_map.scale
        if material.alpha_mode == "MASK":
            self.defines.add("ALPHA_MASK")
            self.uniforms["alpha_cutoff"] = material.alpha_cutoff
        elif material.alpha_mode == "BLEND":
            self.defines.add("ALPHA_BLEND")

    def _compute_textures(self) -> set[_Texture]:
        return set(self.pictures.values())


class _Primitive(pyrender.Primitive):
    """One vertex and one index buffer; pyrender's own passes everything, indices too, through 32-bit floats."""

    TYPES: ClassVar = {
        "position": GL.GL_FLOAT,
        "normal": GL.GL_FLOAT,
        "uv": GL.GL_FLOAT,
        "color": GL.GL_HALF_FLOAT,
        "normal_uv": GL.GL_FLOAT,
        "tangent": GL.GL_FLOAT,
    }

    def __init__(self, primitive: Primitive, material: _Material, origin: NDArray[Any]):
        super().__init__(primitive.positions, material=material)
        self.source, self.origin = primitive, origin
        self.defines = material.defines | (set() if primitive.colors is None else {"HAS_COLOR"})

    def _add_to_context(self):
        vertices, triangles = vertex_records(self.source, self.origin)
        self._vaid = GL.glGenVertexArrays(1)
        self._buffers = [GL.glGenBuffers(1), GL.glGenBuffers(1)]
        GL.glBindVertexArray(self._vaid)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._buffers[0])
        GL.glBufferData(GL.GL_ARRAY_BUFFER, vertices.nbytes, vertices.view(np.uint8), GL.GL_STATIC_DRAW)
        fields: Any = vertices.dtype.fields
        for location, (name, kind) in enumerate(self.TYPES.items()):
            if name in fields:
                dtype, offset = fields[name][:2]
                start, stride = ctypes.c_void_p(offset), vertices.itemsize
                GL.glVertexAttribPointer(location, dtype.shape[0], kind, GL.GL_FALSE, stride, start)
                GL.glEnableVertexAttribArray(location)
        GL.glBindBuffer(GL.GL_ELEMENT_ARRAY_BUFFER, self._buffers[1])
        GL.glBufferData(GL.GL_ELEMENT_ARRAY_BUFFER, triangles.nbytes, triangles, GL.GL_STATIC_DRAW)
        GL.glBindVertexArray(0)


class _Camera(pyrender.Camera):
    """The projection of a `View`."""

    view: View

    def pose(self, origin: Any) -> NDArray[Any]:
        """(4, 4): from view space to model space, with the model moved by -`origin`."""
        return np.vstack([np.column_stack([self.view.basis.T, self.view.center - origin]), np.eye(4)[3]])

    def get_projection_matrix(self, width=None, height=None) -> NDArray[Any]:
        return self.view.clip_from_model() @ self.pose(0.0)


class _Program(ShaderProgram):
    """Names what is wrong with a shader, and refuses a uniform that it lacks; pyrender's own stays silent."""

    def _load(self, shader_filename: str) -> str:
        version, body = Path(shader_filename).read_text(encoding="utf-8").split("\n", 1)
        return "\n".join([version, *(f"#define {name}" for name in self.defines or ()), "#line 2", body])

    def _add_to_context(self):
        program = GL.glCreateProgram()
        for path, kind in ((self.vertex_shader, GL.GL_VERTEX_SHADER), (self.fragment_shader, GL.GL_FRAGMENT_SHADER)):
            shader = GL.glCreateShader(kind)
            GL.glShaderSource(shader, self._load(path))
            GL.glCompileShader(shader)
            if not GL.glGetShaderiv(shader, GL.GL_COMPILE_STATUS):
                error = GpuError(path, f"{GL.glGetShaderInfoLog(shader).decode()}; expected GLSL 330 that compiles")
                lines = Path(path).read_text(encoding="utf-8").splitlines()
                error.add_note("\n".join(f"{number:4d}  {line}" for number, line in enumerate(lines, 1)))
                raise error
            GL.glAttachShader(program, shader)
            GL.glDeleteShader(shader)
        GL.glLinkProgram(program)
        if not GL.glGetProgramiv(program, GL.GL_LINK_STATUS):
            raise GpuError(self.fragment_shader, f"{GL.glGetProgramInfoLog(program).decode()}; expected to link")
        self._program_id, self._vao_id = program, GL.glGenVertexArrays(1)
        self._locations: dict[str, int] = {}

    def set_uniform(self, name: str, value: Any, unsigned: bool = False):
        if name == "cam_pos":  # set by pyrender for its lights
            return
        if name not in self._locations:
            self._locations[name] = GL.glGetUniformLocation(self._program_id, name)
            if self._locations[name] < 0:
                raise GpuError(self.fragment_shader, f"no uniform {name!r}; expected it here or in the vertex shader")
        if isinstance(value, int):  # a sampler's texture unit
            GL.glUniform1i(self._locations[name], value)
            return
        value = np.ascontiguousarray(value, np.float32)
        if value.ndim == 2:
            GL.glUniformMatrix4fv(self._locations[name], 1, GL.GL_TRUE, value)
        else:
            setter = {1: GL.glUniform1fv, 2: GL.glUniform2fv, 4: GL.glUniform4fv}[value.size]
            setter(self._locations[name], 1, value)


class _Programs(ShaderProgramCache):
    def get_program(self, vertex_shader, fragment_shader, geometry_shader=None, defines=None) -> _Program:
        key = (vertex_shader, fragment_shader, *sorted(defines or ()))
        if key not in self._program_cache:
            paths = [str(SHADERS / name) for name in (vertex_shader, fragment_shader)]
            self._program_cache[key] = _Program(*paths, defines=defines)
            self._program_cache[key]._add_to_context()
        return self._program_cache[key]


class _Renderer(pyrender.Renderer):
    """Draws into one colour and one surface target, and reads both back."""

    TARGETS = ((GL.GL_RGBA8, GL.GL_UNSIGNED_BYTE, np.uint8), (GL.GL_RGBA16, GL.GL_UNSIGNED_SHORT, np.uint16))

    def __init__(self, side: int):
        super().__init__(side, side)
        self.dpscale = 1  # these are texels, whatever the screen
        self._program_cache = _Programs()
        self._renderbuffers: list[int] = []

    def _configure_main_framebuffer(self):
        if self._main_fb is not None:
            return
        side = self.viewport_width
        points = [GL.GL_COLOR_ATTACHMENT0 + index for index in range(len(self.TARGETS))]
        formats = [*(target[0] for target in self.TARGETS), GL.GL_DEPTH_COMPONENT24]
        self._renderbuffers = [int(name) for name in GL.glGenRenderbuffers(len(formats))]
        # pyrender draws into the multisampled framebuffer; here every sample is a pixel, so the two are one.
        self._main_fb = self._main_fb_ms = GL.glGenFramebuffers(1)
        GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self._main_fb)
        for point, form, name in zip([*points, GL.GL_DEPTH_ATTACHMENT], formats, self._renderbuffers, strict=True):
            GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, name)
            GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, form, side, side)
            GL.glFramebufferRenderbuffer(GL.GL_DRAW_FRAMEBUFFER, point, GL.GL_RENDERBUFFER, name)
        GL.glDrawBuffers(len(points), points)
        status = GL.glCheckFramebufferStatus(GL.GL_DRAW_FRAMEBUFFER)
        if status != GL.GL_FRAMEBUFFER_COMPLETE:
            raise GpuError("OpenGL", f"framebuffer status {status:#x}; expected a complete one")

    def _delete_main_framebuffer(self):
        if self._main_fb is not None:
            GL.glDeleteFramebuffers(1, [self._main_fb])
            GL.glDeleteRenderbuffers(len(self._renderbuffers), self._renderbuffers)
        self._main_fb = self._main_fb_ms = None

    def _read_main_framebuffer(self, scene, flags) -> list[NDArray[Any]]:
        side, layers = self.viewport_width, []
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._main_fb)
        for index, (_, kind, dtype) in enumerate(self.TARGETS):
            pixels = np.empty((side, side, 4), dtype)
            GL.glReadBuffer(GL.GL_COLOR_ATTACHMENT0 + index)
            GL.glReadPixels(0, 0, side, side, GL.GL_RGBA, kind, array=pixels)
            layers.append(pixels[::-1])
        return layers

    def _get_camera_matrices(self, scene):
        low, high = scene.main_camera_node.camera.view.depth_range
        self._depth_transform = 1 / (high - low), -low / (high - low)
        return super()._get_camera_matrices(scene)

    def _get_primitive_program(self, primitive, flags, program_flags) -> _Program:
        return self._program_cache.get_program("layers.vert", "layers.frag", defines=primitive.defines)

    def _bind_and_draw_primitive(self, primitive, pose, program, flags):
        material = primitive.material
        program.set_uniform("depth_transform", self._depth_transform)
        for name, value in material.uniforms.items():
            program.set_uniform(name, value)
        for unit, (name, picture) in enumerate(material.pictures.items()):
            program.set_uniform(name, unit)
            GL.glActiveTexture(GL.GL_TEXTURE0 + unit)
            picture._bind()
        (GL.glDisable if material.doubleSided else GL.glEnable)(GL.GL_CULL_FACE)
        primitive._bind()
        GL.glDrawElements(GL.GL_TRIANGLES, primitive.source.triangles.size, GL.GL_UNSIGNED_INT, None)
        primitive._unbind()


class _Offscreen(pyrender.OffscreenRenderer):
    """pyrender's context, made current only while it is used, and ended without disturbing others."""

    _platform: Any
    _renderer: Any

    def _create(self):
        try:
            super()._create()
        except Exception:
            if self._platform is not None:
                _forget_display(self._platform)
            raise
        self._renderer = _Renderer(self.viewport_width)

    @contextmanager
    def current(self) -> Iterator[None]:
        """Make this context current; afterwards the caller's is current again, or none."""
        if self._platform is None:
            raise GpuError("capture", "released already; expected one whose context is alive")
        with _callers_context_kept():
            self._platform.make_current()
            try:
                yield
            except OpenGL.error.Error as problem:
                raise GpuError("OpenGL", f"{type(problem).__name__}: {problem}; expected none") from problem

    def delete(self):
        if self._renderer is None:
            return
        with self.current():
            self._renderer.delete()
            OpenGL.contextdata.cleanupContext()
        if EGL:
            EGL.eglDestroyContext(self._platform._egl_display, self._platform._egl_context)
            _forget_display(self._platform)
        else:
            self._platform.delete_context()
        self._renderer = self._platform = None


@contextmanager
def _callers_context_kept() -> Iterator[None]:
    if EGL is None:
        yield
        return
    EGL.eglBindAPI(EGL.EGL_OPENGL_API)
    surfaces = EGL.eglGetCurrentSurface(EGL.EGL_DRAW), EGL.eglGetCurrentSurface(EGL.EGL_READ)
    before = EGL.eglGetCurrentDisplay(), *surfaces, EGL.eglGetCurrentContext()
    try:
        yield
    finally:
        if display := EGL.eglGetCurrentDisplay():
            EGL.eglMakeCurrent(display, EGL.EGL_NO_SURFACE, EGL.EGL_NO_SURFACE, EGL.EGL_NO_CONTEXT)
        if before[0]:
            with suppress(OpenGL.error.Error):  # it may have been destroyed while it was current
                EGL.eglMakeCurrent(*before)


def _forget_display(platform):
    # pyrender would terminate the display, and with it every other EGL context of the process.
    platform._egl_context = platform._egl_display = None
