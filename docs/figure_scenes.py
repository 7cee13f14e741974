"""Figures of objects on the ground: 9, 10, the README's picture, and the comparison with the mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from docs.studio import PAPER, Scene, Studio, captioned, grass, paving
from impostor.lighting import DirectionalLight, Gloss
from impostor.views import rotation_about_y
from runtime.compare import Comparison, between_cameras, errors, side_by_side
from runtime.ground.ground_pass import GroundSurface
from runtime.renderer import ImpostorRenderer
from runtime.viewing.cameras import Camera

# Sun or moon: azimuth and elevation in degrees, linear colour; linear ambient; sRGB of zenith and horizon.
SKIES = (
    (78, 17, (1.5, 0.92, 0.70), (0.26, 0.27, 0.40), (0.55, 0.62, 0.80), (0.99, 0.83, 0.78)),
    (25, 52, (1.05, 1.0, 0.92), (0.28, 0.31, 0.36), (0.36, 0.56, 0.84), (0.80, 0.88, 0.93)),
    (-58, 20, (1.75, 1.0, 0.42), (0.19, 0.21, 0.34), (0.33, 0.38, 0.60), (0.99, 0.74, 0.47)),
    (-100, 42, (0.26, 0.37, 0.66), (0.035, 0.05, 0.11), (0.03, 0.05, 0.13), (0.19, 0.27, 0.45)),
)
WARM, COOL = np.array([1.0, 0.74, 0.50]), np.array([0.34, 0.58, 1.0])


def figure_9(studio: Studio) -> Image.Image:
    """The statue's fan on the ground under two set-ups of two lights."""
    statue = studio.fan("statue", size=512)
    # Half-way between two views, where the fan is least like the mesh.
    azimuth = np.radians(360 / 96 * 8.5)
    eye = np.array([0, 1.1, 0]) + 9 * np.array([0.965 * np.sin(azimuth), 0.26, 0.965 * np.cos(azimuth)])
    camera = Camera.perspective(eye, (0, 1.06, 0), 20, 1, 1, 100)
    background = (0.13, 0.13, 0.15, 1.0)
    surface = GroundSurface((0.30, 0.32, 0.345), reach=44, background=background)
    setups = [
        [DirectionalLight.from_angles(84, 30, 1.3 * WARM), DirectionalLight.from_angles(-76, 22, 0.7 * COOL)],
        [DirectionalLight.from_angles(-20, 30, 1.3 * WARM), DirectionalLight.from_angles(140, 22, 0.7 * COOL)],
    ]
    pictures = [
        Scene(
            lights,
            (0.035, 0.035, 0.045),
            surface,
            lambda renderer: renderer.add(statue, gloss=Gloss(0.12, 40)),
            background[:3],
            background[:3],
        ).draw(studio, camera, 560, 560)
        for lights in setups
    ]
    return captioned([pictures], [["warm light from the right, cool from the left", "the two exchanged"]])


def figure_10(studio: Studio) -> Image.Image:
    """Three fans among polygon trees on a textured ground."""
    house, truck, statue = (
        # Rings as low as this viewer: the house is level with the eye, the others are below it.
        studio.fan(name, 48, 448, elevation_deg)
        for name, elevation_deg in (("house", 3), ("truck", 7), ("statue", 7))
    )
    pine, tree = studio.model("pine"), studio.model("tree")

    def place(renderer: ImpostorRenderer) -> None:
        renderer.add(house, (3.0, 0, -24), np.radians(-28))
        renderer.add(truck, (5.9, 0, -6.5), np.radians(-52))
        renderer.add(statue, (-4.3, 0, -4), np.radians(18), 1.35, Gloss(0.1, 40))
        for model, x, z, turn, scale in (
            (tree, -11.2, -20, 0.3, 1.0),
            (tree, 14.6, -22, 2.1, 0.9),
            (pine, -5.5, -34, 0.0, 1.1),
            (pine, -17.5, -40, 1.0, 1.25),
            (pine, 15.0, -42, 2.5, 1.2),
            (pine, 20.5, -38, 1.7, 1.1),
            (pine, -12.5, -46, 0.4, 1.15),
        ):
            renderer.add_mesh(model, _matrix((x, 0, z), turn, scale))

    scene = Scene(
        [DirectionalLight.from_angles(-62, 36, (0.98, 0.92, 0.80))],
        (0.24, 0.27, 0.32),
        GroundSurface((1, 1, 1), paving(), 4.0, reach=110),
        place,
    )
    camera = Camera.perspective((0, 3.0, 12), (0.4, 2.9, -8), 31, 16 / 9, 1, 300)
    return scene.draw(studio, camera, 1280, 720)


def hero(studio: Studio) -> Image.Image:
    """One clearing under four skies; nothing but lights and background changes from one to the next."""
    cottage, truck, statue, tree, pine = (
        studio.fan(name, 48, size, 8)
        for name, size in (("house", 320), ("truck", 256), ("statue", 256), ("tree", 256), ("pine", 256))
    )

    def place(renderer: ImpostorRenderer) -> None:
        rng = np.random.default_rng(3)
        for fan, standing in zip((tree, pine), _wood(), strict=True):
            count = len(standing)
            renderer.add(fan, standing, rng.uniform(0, 2 * np.pi, count), rng.uniform(0.75, 1.25, count))
        renderer.add(cottage, (0.3, 0, -4), np.radians(-24))
        renderer.add(truck, (-3.3, 0, 9), np.radians(42))
        renderer.add(statue, (4.1, 0, 10), np.radians(-20), 1.3)

    camera = Camera.perspective((0, 8.8, 56), (0, 4.7, 0), 19.5, 297 / 420, 5, 900)
    surface = GroundSurface((1.15, 1.15, 1.15), grass(), 26.0, reach=420)
    page = Image.new("RGB", (1200, 420), PAPER)
    for left, (azimuth, elevation, *colors) in zip(range(0, 1200, 301), SKIES, strict=True):
        sun, ambient, zenith, horizon = colors
        scene = Scene([DirectionalLight.from_angles(azimuth, elevation, sun)], ambient, surface, place, zenith, horizon)
        page.paste(scene.draw(studio, camera, 297, 420), (left, 0))
    return page


def _wood() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Spots (N, 3) for broadleaf trees and for pines around a clearing, at least 5.5 m between trunks."""
    rng = np.random.default_rng(12)
    spots = np.empty((0, 2))
    for spot in rng.uniform((-60, -150), (60, 14), (3000, 2)):
        x, z = spot
        clearing = (x / 14) ** 2 + ((z - 4) / 17) ** 2 < 1 or z > -8
        if not clearing and (len(spots) == 0 or np.hypot(*(spots - spot).T).min() > 5.5):
            spots = np.vstack([spots, spot])
    standing = np.column_stack([spots[:, 0], np.zeros(len(spots)), spots[:, 1]])
    pine = rng.uniform(size=len(spots)) < np.clip(-spots[:, 1] / 60, 0.15, 0.6)
    return standing[~pine], standing[pine]


def compare(studio: Studio) -> Image.Image:
    """Mesh, impostor and difference, from a camera between the baked views."""
    rows, captions = [], []
    for name in ("statue", "truck"):
        fan, model = studio.fan(name, size=320), studio.model(name)
        comparison = Comparison(studio.ctx, fan, model, 320)
        try:
            pair = comparison.pair(between_cameras(fan, 8)[1], np.radians(15))
        finally:
            comparison.release()
        picture = side_by_side([pair])
        rows.append([Image.fromarray(part) for part in np.split(picture, 3, axis=1)])
        captions.append(["mesh", "impostor", f"difference x 4 ({errors(pair)[0]:.1f} dB)"])
    return captioned(rows, captions)


def _matrix(position: tuple[float, float, float], yaw: float, scale: float) -> NDArray[np.float64]:
    matrix = np.eye(4)
    matrix[:3, :3] = scale * rotation_about_y(yaw)
    matrix[:3, 3] = position
    return matrix
