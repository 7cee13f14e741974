"""Table "surfaces": surfaces with a PTM against the same mesh with one plain texture."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial

import moderngl
import numpy as np

from benchmarks.scenes import HEIGHT, WIDTH
from benchmarks.tables import Bar, Row, Table
from benchmarks.timing import alternate
from benchmarks.workbench import Workbench, say
from impostor.lighting import DirectionalLight, Gloss, LocalLight
from impostor.model import Model
from impostor.ptm.quantise import Ptm
from runtime.gl.offscreen import Offscreen
from runtime.gl.programs import set_uniforms
from runtime.gl.state import preserved_state
from runtime.surfaces.buffers import Light, SurfaceBuffers
from runtime.surfaces.relit_pictures import PATIENCE
from runtime.surfaces.surface_pass import Surface, SurfacePass, rectangle
from runtime.viewing.cameras import Camera
from runtime.viewing.viewer import Viewer

SIDE = 2048
MOST = 2.0
AMBIENT = 0.2
SUN = DirectionalLight.from_angles(30, 40, (0.8, 0.7, 0.6))
LAMPS = [LocalLight((0.3 * x, 0.2, 0.8), (0.5, 0.4, 0.3)) for x in (-1, 0, 1)]
CAMERA = Camera.perspective((0, 0, 0.562 / np.tan(np.radians(22.5))), (0, 0, 0), 45, WIDTH / HEIGHT, 0.1, 10)

VERTEX = """
#version 330
uniform mat4 clip_from_world;
in vec3 position;
in vec2 uv;
out vec2 v_uv;
void main() {
    gl_Position = clip_from_world * vec4(position, 1.0);
    v_uv = uv;
}
"""
FRAGMENT = """
#version 330
uniform sampler2D picture;
in vec2 v_uv;
out vec4 color;
void main() {
    color = texture(picture, v_uv);
}
"""


class PlainSurface:
    """The same mesh with one RGBA8 texture, drawn in one bare call with one fetch."""

    def __init__(self, ctx: moderngl.Context, model: Model, pixels: bytes):
        self._ctx, self._buffers = ctx, SurfaceBuffers(ctx, model)
        self._program = ctx.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT)
        set_uniforms(self._program, clip_from_world=CAMERA.clip_from_view @ CAMERA.view_from_world)
        self._texture = ctx.texture((SIDE, SIDE), 4, pixels)
        self._texture.build_mipmaps()
        self._texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)

    def draw(self) -> None:
        """Draw into the bound framebuffer."""
        self._ctx.enable_only(moderngl.DEPTH_TEST)
        self._texture.use(0)
        self._buffers.vertex_array(self._ctx, self._program).render(moderngl.TRIANGLES)
        self._ctx.enable_only(moderngl.NOTHING)

    def release(self) -> None:
        """Free everything on the GPU."""
        for resource in (self._buffers, self._program, self._texture):
            resource.release()


def run(bench: Workbench) -> Table:
    """One surface that fills the picture, by how it is lit."""
    columns = {
        "plain_ms": "plain texture, ms",
        "surface_ms": "PTM surface, ms",
        "ratio": "PTM / plain",
        "upload_ms": "upload, once, ms",
        "relight_ms": "relight, once, ms",
    }
    table = Table("surfaces", f"A PTM of {SIDE} x {SIDE} texels that fills {WIDTH} x {HEIGHT} pixels", columns)
    rng, model, target = np.random.default_rng(0), rectangle(2, 2), Offscreen(bench.ctx, WIDTH, HEIGHT)
    plain = PlainSurface(bench.ctx, model, rng.bytes(4 * SIDE * SIDE))

    def plain_frame() -> None:
        target.clear()
        plain.draw()

    for kind in ("LRGB", "RGB"):
        say(f"surfaces: {kind}")
        ptm = noise_ptm(kind, rng)
        for name, (gloss, lights) in LIGHTINGS.items():
            frames = SurfaceFrames(bench.ctx, target, Surface(ptm, model, gloss=gloss), lights)
            times = alternate(plain_frame, frames.draw, ctx=bench.ctx, warm_up=PATIENCE + 2)
            still = name == STILL
            values = {
                "plain_ms": times.median(0) * 1e3,
                "surface_ms": times.median(1) * 1e3,
                "ratio": times.ratio(1, 0),
                "upload_ms": frames.upload_seconds * 1e3 if still else None,
                "relight_ms": frames.relight_seconds() * 1e3 if still else None,
            }
            bars = (Bar("ratio", "<=", MOST),) if still else ()
            table.rows.append(Row(f"{kind} {name}", f"{kind}, {name}", values, bars))
            frames.release()
    plain.release()
    target.release()
    table.notes.append(
        "The plain texture is RGBA8 on the same mesh, trilinear as the PTM is, in one bare call. Where its lights are "
        f"directional and have stood still for {PATIENCE} draws, a flat surface is drawn from a relit picture; else it "
        "is lit pixel by pixel, from 2 textures (LRGB) or 5 (RGB). Beside the named lights there is an ambient "
        "one. Under a light that moves, fetches take nearly all of the time: without the sRGB curve it was 7 "
        "percent less. With one mip level a fetch it was 2.4 (LRGB) and 3.6 times (RGB) a plain texture, but the "
        "steps between levels show. The time to relight says that relighting just the levels in view would cost "
        "what lighting the pixels does. So the bar stands for a light that stands still."
    )
    return table


class SurfaceFrames:
    """Frames of one surface under lights, which may differ from frame to frame."""

    def __init__(
        self, ctx: moderngl.Context, target: Offscreen, surface: Surface, lights: Callable[[int], Sequence[Light]]
    ):
        self._ctx, self._target, self._surface, self._lights = ctx, target, surface, lights
        self._pass, self._count = SurfacePass(ctx, anisotropy=1.0), 0
        start = time.perf_counter()
        with preserved_state(ctx):
            self._pass.prepare([surface])
        ctx.finish()
        self.upload_seconds = time.perf_counter() - start

    def draw(self) -> None:
        """Draw a frame."""
        self._target.clear()
        self._count += 1
        with preserved_state(self._ctx) as state:
            viewer = Viewer.from_matrices(*CAMERA.matrices, state.viewport)
            self._pass.draw(state, [self._surface], viewer, self._lights(self._count), AMBIENT)

    def relight_seconds(self) -> float:
        """What the frame in which a picture is relit takes longer than the next one: the median of three."""
        seconds = []
        for turn in range(3):
            self._lights = partial(turned_sun, 1000 + turn)
            for _ in range(PATIENCE):
                self.draw()
            self._ctx.finish()
            for _ in range(2):
                start = time.perf_counter()
                self.draw()
                self._ctx.finish()
                seconds.append(time.perf_counter() - start)
        return float(np.median(np.subtract(seconds[0::2], seconds[1::2])))

    def release(self) -> None:
        """Free everything on the GPU."""
        self._pass.release()


def turned_sun(degrees: int, *_: int) -> Sequence[Light]:
    """The sun, that many degrees farther."""
    return [DirectionalLight.from_angles(30 + degrees % 60, 40, SUN.color)]


STILL = "light still"
LIGHTINGS: dict[str, tuple[Gloss, Callable[[int], Sequence[Light]]]] = {
    STILL: (Gloss(), lambda _: [SUN]),
    "light moves": (Gloss(), turned_sun),
    "a lamp": (Gloss(), lambda _: LAMPS[:1]),
    "sun and 3 lamps": (Gloss(), lambda _: [SUN, *LAMPS]),
    "highlight": (Gloss(0.3), lambda _: [SUN]),
}


def noise_ptm(kind: str, rng: np.random.Generator) -> Ptm:
    """A PTM whose texels have nothing to do with each other."""
    channels = 1 if kind == "LRGB" else 3
    coefficients = rng.integers(100, 156, (SIDE, SIDE, channels, 6), dtype=np.uint8)
    color = rng.integers(0, 256, (SIDE, SIDE, 3), dtype=np.uint8) if kind == "LRGB" else None
    return Ptm(coefficients, np.full(6, 2.0), np.array([128] * 5 + [0]), color)
