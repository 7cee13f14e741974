"""Figures of objects on the ground: 9, 10, the README's picture, and the comparison with the mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from docs.studio import Scene, Studio, captioned, grass, paving
from impostor.lighting import DirectionalLight, Gloss
from impostor.views import rotation_about_y
from runtime.cameras import Camera
from runtime.compare import Comparison, between_cameras, errors, side_by_side
from runtime.grounds import GroundSurface
from runtime.renderer import ImpostorRenderer

WARM, COOL = np.array([1.0, 0.72, 0.45]), np.array([0.45, 0.66, 1.0])


def figure_9(studio: Studio) -> Image.Image:
    """The statue's fan on the ground under two set-ups of two lights."""
    statue = studio.fan("statue.glb", size=512)
    # Half-way between two views, where the fan is least like the mesh.
    azimuth = np.radians(360 / 96 * 8.5)
    eye = np.array([0, 1.1, 0]) + 9 * np.array([0.965 * np.sin(azimuth), 0.26, 0.965 * np.cos(azimuth)])
    camera = Camera.perspective(eye, (-0.1, 1.02, 0), 21, 5 / 6, 1, 100)
    background = (0.30, 0.31, 0.33, 1.0)
    surface = GroundSurface((0.52, 0.5, 0.47), reach=26, background=background)
    setups = [
        [DirectionalLight.from_angles(95, 34, 0.85 * WARM), DirectionalLight.from_angles(-40, 26, 0.42 * COOL)],
        [DirectionalLight.from_angles(-35, 38, 0.85 * WARM), DirectionalLight.from_angles(80, 22, 0.42 * COOL)],
    ]
    pictures = [
        Scene(
            lights,
            (0.10, 0.10, 0.12),
            surface,
            lambda renderer: renderer.add(statue, gloss=Gloss(0.12, 40)),
            background[:3],
            background[:3],
        ).draw(studio, camera, 500, 600)
        for lights in setups
    ]
    return captioned([pictures], [["warm light from the right, cool from the left", "the two exchanged"]])


def figure_10(studio: Studio) -> Image.Image:
    """Three fans among polygon trees on a textured ground."""
    house, truck, statue = (
        studio.fan(name, 96, size, 8.0) for name, size in (("house.glb", 512), ("truck.glb", 512), ("statue.glb", 512))
    )
    pine, tree = studio.model("pine.obj"), studio.model("tree.glb")

    def place(renderer: ImpostorRenderer) -> None:
        renderer.add(house, (4.0, 0, -24), np.radians(-28))
        renderer.add(truck, (7.2, 0, -6.5), np.radians(-52))
        renderer.add(statue, (-4.6, 0, -3), np.radians(18), 1.25, Gloss(0.1, 40))
        for model, x, z, turn, scale in (
            (tree, -13.0, -20, 0.3, 1.05),
            (tree, 17.5, -19, 2.1, 0.95),
            (pine, -5.5, -34, 0.0, 1.1),
            (pine, -21.0, -38, 1.0, 1.25),
            (pine, 15.0, -42, 2.5, 1.2),
            (pine, 25.0, -38, 1.7, 1.1),
            (tree, -29.0, -33, 1.2, 1.1),
            (pine, -12.5, -46, 0.4, 1.15),
        ):
            renderer.add_mesh(model, _matrix((x, 0, z), turn, scale))

    scene = Scene(
        [DirectionalLight.from_angles(-62, 36, (1.05, 0.98, 0.85))],
        (0.24, 0.27, 0.32),
        GroundSurface((1, 1, 1), paving(), 4.0, reach=110),
        place,
    )
    camera = Camera.perspective((0, 2.4, 12), (0.6, 2.55, -8), 38, 16 / 9, 1, 300)
    return scene.draw(studio, camera, 1280, 720)


def hero(studio: Studio) -> Image.Image:
    """A hamlet among relit trees in the last hour of sun."""
    rng = np.random.default_rng(11)
    fans = {
        "tree": studio.fan("tree.glb", 48),
        "pine": studio.fan("pine.obj", 48),
        "house": studio.fan("house.glb", 96, 512),
        "truck": studio.fan("truck.glb", 96),
        "statue": studio.fan("statue.glb", 96),
    }
    broad, pines = _forest(rng)

    def place(renderer: ImpostorRenderer) -> None:
        for fan, spots in ((fans["tree"], broad), (fans["pine"], pines)):
            scales = rng.uniform(0.75, 1.25, len(spots))
            renderer.add(fan, spots, rng.uniform(0, 2 * np.pi, len(spots)), scales)
        renderer.add(fans["house"], (5, 0, -4), np.radians(-22))
        renderer.add(fans["truck"], (-6.5, 0, 4.5), np.radians(64))
        renderer.add(fans["statue"], (18.0, 0, 7), np.radians(-25), 1.7)

    scene = Scene(
        [DirectionalLight.from_angles(-72, 17, (2.1, 1.25, 0.55))],
        (0.20, 0.24, 0.36),
        GroundSurface((1, 1, 1), grass(), 22.0, reach=260),
        place,
        (0.36, 0.47, 0.66),
        (0.98, 0.80, 0.58),
    )
    camera = Camera.perspective((0, 14.5, 64), (0, 5.2, 0), 19, 1200 / 420, 5, 600)
    return scene.draw(studio, camera, 1200, 420)


def _forest(rng: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Spots (N, 3) for broadleaf trees and for pines: a wood behind a clearing, at least 5 m between trunks."""
    spots = np.empty((0, 2))
    for spot in rng.uniform((-75, -75), (75, 22), (2500, 2)):
        x, z = spot
        clearing = (x / 27) ** 2 + ((z - 6) / 19) ** 2 < 1 or (abs(x) < 25 and z > 0)
        if not clearing and (len(spots) == 0 or np.hypot(*(spots - spot).T).min() > 5.5):
            spots = np.vstack([spots, spot])
    standing = np.column_stack([spots[:, 0], np.zeros(len(spots)), spots[:, 1]])
    pine = rng.uniform(size=len(spots)) < np.clip(-spots[:, 1] / 60, 0.15, 0.8)
    return standing[~pine], standing[pine]


def compare(studio: Studio) -> Image.Image:
    """Mesh, impostor and difference, from a camera between the baked views."""
    rows, captions = [], []
    for name in ("statue.glb", "truck.glb"):
        fan, model = studio.fan(name, size=512 if name == "statue.glb" else 256), studio.model(name)
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
