"""A forest of 1,500 relit trees in a moderngl-window window: `python examples/windowed_forest.py [--picture OUT.png]`.

The sun goes round, the mouse wheel comes nearer. `--picture` saves the first frame and ends; with `--window headless
--backend egl` it needs no screen.
"""

from pathlib import Path

import moderngl_window as mglw
import numpy as np
from PIL import Image

import impostor
from bake.fan import bake_fan
from runtime import Camera, GroundSurface, ImpostorRenderer

PINE = Path(__file__).resolve().parents[1] / "sample_models" / "pine.obj"
GROUND, GRASS = impostor.Ground(np.array([0, 1, 0])), GroundSurface((0.10, 0.15, 0.05), reach=300)


class Forest(mglw.WindowConfig):
    gl_version = (3, 3)
    title = "Impostors: 1,500 trees of 10,004 triangles each"
    window_size = (1280, 720)
    samples = 4
    aspect_ratio = None

    @classmethod
    def add_arguments(cls, parser):
        parser.add_argument("--picture", type=Path)

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        rng, self.distance = np.random.default_rng(1), 75.0
        self.renderer = ImpostorRenderer(self.ctx)
        fan = bake_fan(impostor.load_model(PINE), views=32, size=128)
        places = rng.uniform(-140, 140, (1500, 3)) * [1, 0, 1]
        yaws = rng.integers(0, 12, 1500) * np.pi / 6  # few different ones: tiles are shared
        self.renderer.add(fan, places, yaws, rng.uniform(0.6, 1.5, 1500))

    def on_mouse_scroll_event(self, x_offset, y_offset):
        self.distance = float(np.clip(self.distance * 0.9**y_offset, 30, 150))

    def on_render(self, time, frame_time):
        height = 15 + 30 * np.cos(0.4 * time)
        warmth = np.clip(height / 30, 0, 1)
        sun = np.array([2.0, 0.9 + 0.9 * warmth, 0.4 + 1.2 * warmth]) * np.clip(height / 6, 0, 1)
        self.renderer.lights = [impostor.DirectionalLight.from_angles(60 * time - 100, max(height, 0.1), sun)]
        self.renderer.ambient = np.array([0.11, 0.15, 0.24]) * (0.4 + warmth)
        eye = self.distance * np.array([np.sin(0.05 * time), 0.28, np.cos(0.05 * time)])
        camera = Camera.perspective(eye, (0, 3, 0), 45, self.wnd.aspect_ratio, 1, 500)
        self.ctx.clear(*(np.array([0.5, 0.62, 0.75]) * (0.2 + 0.8 * warmth)), 1.0)
        self.renderer.draw_ground(*camera.matrices, GROUND, GRASS)
        self.renderer.draw_shadows(*camera.matrices, GROUND)
        self.renderer.draw(*camera.matrices)
        if self.argv and self.argv.picture:
            size, shown = self.wnd.buffer_size, self.wnd.fbo
            copy = self.ctx.simple_framebuffer(size)
            self.ctx.copy_framebuffer(copy, shown)
            Image.frombytes("RGB", size, copy.read()).transpose(Image.Transpose.FLIP_TOP_BOTTOM).save(self.argv.picture)
            self.wnd.close()


if __name__ == "__main__":
    mglw.run_window_config(Forest)
