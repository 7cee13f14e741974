"""A forest of 1,500 relit trees in a moderngl-window window; `--picture OUT.png` saves the first frame and ends."""

from pathlib import Path

import numpy as np
from moderngl_window import run_window_config
from moderngl_window.context.base import WindowConfig
from PIL import Image, ImageOps

import impostor
from bake.fan import bake_fan
from runtime import Camera, GroundSurface, ImpostorRenderer

TREE = Path(__file__).resolve().parents[1] / "sample_models" / "tree.glb"
GROUND, GRASS = impostor.Ground(np.array([0, 1, 0])), GroundSurface((0.15, 0.16, 0.06), reach=900)


class Forest(WindowConfig):
    gl_version = (3, 3)
    title = "Impostors: 1,500 trees of 9,666 triangles each"
    window_size = (1280, 720)
    samples = 4
    aspect_ratio = None
    fan = bake_fan(impostor.load_model(TREE), views=32, size=160)  # before there is a window and its context

    @classmethod
    def add_arguments(cls, parser):
        parser.add_argument("--picture", type=Path)

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        rng, self.renderer = np.random.default_rng(1), ImpostorRenderer(self.ctx)
        places = rng.uniform(-210, 210, (1500, 3)) * [1, 0, 1]
        yaws = rng.integers(0, 12, 1500) * np.pi / 6  # few different ones: tiles are shared
        self.renderer.add(self.fan, places, yaws, rng.uniform(0.6, 1.3, 1500))

    def on_render(self, time, frame_time):
        height = 12 + 20 * np.cos(0.4 * time)  # of the sun, in degrees
        warmth = np.clip(height / 24, 0, 1)
        sun = np.array([2.0, 0.9 + 0.9 * warmth, 0.4 + 1.2 * warmth]) * np.clip(height / 6, 0, 1)
        self.renderer.lights = [impostor.DirectionalLight.from_angles(8 * time - 75, max(height, 0.1), sun)]
        self.renderer.ambient = np.array([0.11, 0.15, 0.24]) * (0.4 + warmth)
        eye = 110 * np.array([np.sin(0.05 * time), 0.22, np.cos(0.05 * time)])
        camera = Camera.perspective(eye, (0, 3, 0), 45, self.wnd.aspect_ratio, 1, 600)
        self.ctx.clear(*(np.array([0.62, 0.70, 0.80]) * (0.2 + 0.8 * warmth)).tolist())
        self.renderer.draw_ground(*camera.matrices, GROUND, GRASS)
        self.renderer.draw_shadows(*camera.matrices, GROUND)
        self.renderer.draw(*camera.matrices)
        if self.argv and self.argv.picture:
            shown = self.ctx.simple_framebuffer(self.wnd.buffer_size)
            self.ctx.copy_framebuffer(shown, self.wnd.fbo)
            ImageOps.flip(Image.frombytes("RGB", shown.size, shown.read())).save(self.argv.picture)
            self.wnd.close()


if __name__ == "__main__":
    run_window_config(Forest)
