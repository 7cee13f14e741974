"""What the figures share: sample models and their fans, one OpenGL context, skies, grounds and captions."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFont

from bake.capture import Capture
from bake.fan import bake_fan
from bake.resolve import TileLayers, resolve
from impostor.errors import ModelWarning
from impostor.fan import Fan
from impostor.lighting import DirectionalLight
from impostor.model import Model, load_model
from impostor.shadow_projection import Ground
from impostor.views import basis_facing, direction, frame
from runtime.gl.context import make_context
from runtime.gl.offscreen import Offscreen
from runtime.ground.ground_pass import GroundSurface
from runtime.renderer import ImpostorRenderer
from runtime.viewing.cameras import Camera

SAMPLES = Path(__file__).resolve().parents[1] / "sample_models"
MODELS = {
    "house": "house.glb",
    "knot": "knot.stl",
    "pine": "pine.obj",
    "statue": "statue.glb",
    "tree": "tree.glb",
    "truck": "truck.glb",
}
GROUND = Ground(np.array([0.0, 1.0, 0.0]))
PAPER, INK = (250, 249, 246), (48, 46, 44)
GAP = 12


class Studio:
    """Loads and bakes each sample model once, whatever number of figures show it."""

    def __init__(self):
        self._models: dict[str, Model] = {}
        self._fans: dict[tuple[Any, ...], Fan] = {}

    @cached_property
    def ctx(self) -> moderngl.Context:
        """Made when the first figure draws."""
        return make_context()

    def model(self, name: str) -> Model:
        """One of MODELS."""
        if name not in self._models:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ModelWarning)
                self._models[name] = load_model(SAMPLES / MODELS[name])
        return self._models[name]

    def fan(self, name: str, views: int = 96, size: int = 256, elevation_deg: float = 15.0) -> Fan:
        """Its fan: a ring of views."""
        key = name, views, size, elevation_deg
        if key not in self._fans:
            self._fans[key] = bake_fan(self.model(name), views=views, size=size, elevation_deg=elevation_deg)
        return self._fans[key]

    def exact_layers(self, name: str, azimuth_deg: float, size: int) -> tuple[TileLayers, NDArray[np.float64]]:
        """One view's layers before the normals are coded, and the view's basis (3, 3)."""
        model = self.model(name)
        basis = basis_facing(direction(np.radians(azimuth_deg), np.radians(15)))
        view = frame(basis[None], np.concatenate([part.positions for part in model.primitives]), size)[0]
        with Capture(model, size) as capture:
            return resolve(capture.view(view), capture.samples), basis


@dataclass
class Scene:
    """A ground, a sky, lights and what stands on the ground.

    Parameters
    ----------
    lights : sequence of DirectionalLight
    ambient : array_like, (3,) float
    surface : GroundSurface
    zenith, horizon : tuple of float
        sRGB colours of the sky, 0 to 1, at the top of the picture and on the horizon.
    place : callable
        Adds the scene's fans and meshes to a renderer.
    """

    lights: Sequence[DirectionalLight]
    ambient: ArrayLike
    surface: GroundSurface
    place: Callable[[ImpostorRenderer], object]
    zenith: tuple[float, float, float] = (0.42, 0.58, 0.80)
    horizon: tuple[float, float, float] = (0.80, 0.86, 0.90)
    samples: int = field(default=2)

    def draw(self, studio: Studio, camera: Camera, width: int, height: int) -> Image.Image:
        """One picture, in the order: meshes, ground, shadows, impostors."""
        renderer, target = ImpostorRenderer(studio.ctx), Offscreen(studio.ctx, width, height, self.samples)
        try:
            renderer.lights, renderer.ambient = self.lights, self.ambient
            self.place(renderer)
            target.clear()
            renderer.draw_meshes(*camera.matrices)
            renderer.draw_ground(*camera.matrices, GROUND, self.surface)
            renderer.draw_shadows(*camera.matrices, GROUND)
            renderer.draw(*camera.matrices)
            pixels = target.color()
        finally:
            renderer.release()
            target.release()
        return self._over_sky(pixels, camera)

    def _over_sky(self, pixels: NDArray[np.uint8], camera: Camera) -> Image.Image:
        height = len(pixels)
        # Where the picture's middle column meets the horizon: the level direction straight ahead.
        ahead = camera.view_from_world[2, :3] * [-1, 0, -1]
        clip = camera.clip_from_view @ np.append(camera.view_from_world[:3, :3] @ ahead, 0)
        horizon = (1 - clip[1] / clip[3]) / 2 * height if clip[3] > 0 else 0.0
        up = np.clip((horizon - np.arange(height)) / max(horizon, 1), 0, 1)[:, None, None]
        sky = np.array(self.horizon) + up**0.7 * (np.array(self.zenith) - np.array(self.horizon))
        values = pixels.astype(float) / 255
        return Image.fromarray(to_bytes(values[..., :3] + (1 - values[..., 3:]) * sky))


def to_bytes(values: ArrayLike) -> NDArray[np.uint8]:
    """0..1 to 0..255."""
    return np.rint(np.clip(values, 0, 1) * 255).astype(np.uint8)


@cache
def font(size: int) -> Any:
    """Pillow's own."""
    return ImageFont.load_default(size)


def captioned(rows: Sequence[Sequence[Image.Image]], captions: Sequence[Sequence[str]], size: int = 15) -> Image.Image:
    """Pictures in rows, equally wide in a column, each with a line of text under it (none for "")."""
    line = size + 10
    widths = [max(picture.width for picture in column) for column in zip(*rows, strict=True)]
    heights = [row[0].height + (line if any(text) else 0) for row, text in zip(rows, captions, strict=True)]
    total = sum(widths) + GAP * (len(widths) + 1), sum(heights) + GAP * (len(rows) + 1)
    page = Image.new("RGB", total, PAPER)
    draw = ImageDraw.Draw(page)
    top = GAP
    for row, texts, height in zip(rows, captions, heights, strict=True):
        left = GAP
        for picture, text, width in zip(row, texts, widths, strict=True):
            page.paste(picture, (left, top))
            draw.text((left + picture.width / 2, top + picture.height + 5), text, INK, font(size), anchor="ma")
            left += width + GAP
        top += height + GAP
    return page


def tileable_noise(size: int, smallest: float, seed: int) -> NDArray[np.float64]:
    """Noise (size, size) without seams, mean 0 and deviation 1, of detail down to `smallest` texels."""
    spectrum = np.fft.fft2(np.random.default_rng(seed).normal(size=(size, size)))
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(size), np.fft.fftfreq(size)))
    shape = np.exp(-((frequency * smallest) ** 2)) / np.maximum(frequency, 1 / size) ** 0.8
    noise = np.fft.ifft2(spectrum * shape).real
    return (noise - noise.mean()) / noise.std()


def grass(size: int = 512) -> NDArray[np.uint8]:
    """A meadow, (size, size, 4) uint8, sRGB, without seams."""
    fine, broad, dry = (tileable_noise(size, texels, seed) for texels, seed in ((1.2, 1), (12, 2), (30, 3)))
    color = np.array([0.36, 0.44, 0.20]) * (1 + 0.16 * fine + 0.05 * broad)[..., None]
    color += np.clip(dry, 0, 2)[..., None] * np.array([0.05, 0.03, 0.01])
    return np.dstack([to_bytes(color), np.full((size, size), 255, np.uint8)])


def paving(size: int = 512, across: int = 4) -> NDArray[np.uint8]:
    """Slabs of stone in a running bond, (size, size, 4) uint8, sRGB, without seams."""
    v, u = np.mgrid[:size, :size] / size
    row = np.floor(v * across * 2).astype(int)
    shifted = u * across + 0.5 * (row % 2)
    column = np.floor(shifted).astype(int) % across
    edge = np.minimum(_to_edge(shifted) / across, _to_edge(v * across * 2) / (2 * across)) * size
    shade = np.random.default_rng(5).normal(0, 0.035, (across * 2, across, 1))
    stone = np.array([0.63, 0.60, 0.55]) + shade[row % (2 * across), column]
    stone += 0.014 * tileable_noise(size, 8, 6)[..., None] + 0.02 * tileable_noise(size, 20, 7)[..., None]
    joint = np.clip(edge / 2.5 - 0.3, 0, 1)[..., None]
    color = joint * stone + (1 - joint) * np.array([0.40, 0.38, 0.33])
    return np.dstack([to_bytes(color), np.full((size, size), 255, np.uint8)])


def _to_edge(position: NDArray[np.float64]) -> NDArray[np.float64]:
    part = position % 1
    return np.minimum(part, 1 - part)
