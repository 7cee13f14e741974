"""A few scenes against their kept pictures, on the one rasteriser whose pixels are the same everywhere.

To keep new pictures, look at them first: `UPDATE_PICTURES=1 python -m pytest tests/golden`, then `git diff --stat`.
"""

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from impostor.lighting import DirectionalLight, Gloss
from impostor.shadow_projection import Ground
from runtime.gl.offscreen import Offscreen
from runtime.ground.ground_pass import GroundSurface
from tests.data import ROOT
from tests.pictures import filling, looking, placed
from tests.solids import GREY, Box, Sphere, solid_fan, solid_model

HERE, OUTPUT = Path(__file__).parent, ROOT / "tests" / "output"
SIZE = 128
LARGEST = 4  # a channel may be this far off
MAY_DIFFER = 16  # pixels that may be farther off
GAIN = 16  # of the difference, in the picture of it
RASTERISER = "llvmpipe"

LEVEL = Ground((0, 1, 0))
SKY = (0.6, 0.7, 0.8, 1.0)
MEADOW = GroundSurface(albedo=(0.35, 0.4, 0.3), reach=60, background=SKY)
STATUE = (Sphere((0, 1.5, 0), 0.45, (220, 200, 170)), Box((-0.35, 0, -0.35), (0.35, 1.05, 0.35), (150, 140, 130)))
TOWER = tuple(
    Box((-0.6 + 0.1 * level, 0.4 * level, -0.6), (0.6, 0.4 * level + 0.4, 0.6 - 0.2 * level), color)
    for level, color in enumerate([(200, 60, 40), (230, 200, 60), (60, 140, 80), (50, 80, 170)])
)
TREE = (Box((-0.12, 0, -0.12), (0.12, 0.8, 0.12), (110, 80, 50)), Sphere((0, 1.4, 0), 0.75, (70, 130, 60)))
RING = {"views": 24, "elevation_deg": 15.0, "size": 64}
SUN, LAMP = (
    DirectionalLight.from_angles(-50, 40, (0.7, 0.65, 0.5)),
    DirectionalLight.from_angles(70, 30, (0.1, 0.2, 0.5)),
)


def statue_and_mesh(renderer):
    """A fan and a mesh that intersect, and both their shadows under two lights."""
    renderer.lights, renderer.ambient = [SUN, LAMP], 0.15
    renderer.add(solid_fan(*STATUE, **RING), (-0.2, 0, 0), 0.4)
    renderer.add_mesh(solid_model(Sphere((0, 0.5, 0), 0.5, (190, 90, 80))), placed((0.3, 0, 0.3)))
    return filling(1.8, 0.3, 0.35, (0.1, 0.8, 0))


def painted_towers(renderer):
    """Copies of a painted fan, turned, scaled and overlapping."""
    renderer.lights, renderer.ambient = [SUN], 0.3
    renderer.add(
        solid_fan(*TOWER, **RING), [(-1.2, 0, 0), (0.4, 0, -0.6), (0.9, 0, 0.8)], [0.0, 0.8, 2.1], [1, 1.2, 0.7]
    )
    return filling(2.2, 0.15, 0.26, (0, 0.9, 0))


def glossy_balls(renderer):
    """Highlights of two lights: one colour by the one-texture path, more by the other."""
    renderer.lights, renderer.ambient = [SUN, DirectionalLight.from_angles(60, 50, (0.5, 0.5, 0.5))], 0.1
    renderer.add(solid_fan(Sphere((0, 1, 0), 1.0, GREY), **RING), (-1.1, 0, 0), gloss=Gloss(0.6, 30))
    renderer.add(solid_fan(Sphere((0, 1, 0), 1.0, (180, 60, 60)), Sphere((0, 1.7, 0), 0.5, (60, 60, 180)), **RING),
                 (1.1, 0, 0), gloss=Gloss(0.6, 30))  # fmt: skip
    return filling(2.4, 0.0, 0.26, (0, 1, 0))


def grove(renderer):
    """Perspective: trees near and far, their shadows, the horizon."""
    renderer.lights, renderer.ambient = [SUN], 0.25
    random = np.random.default_rng(7)
    positions = random.uniform((-9, 0, -30), (9, 0, 2), (60, 3))
    renderer.add(solid_fan(*TREE, **RING), positions, random.uniform(0, 6, 60), random.uniform(0.7, 1.4, 60))
    return looking((0, 2.2, 9), (0, 1, -6), 50, 0.3, 120)


def difference(found, reference):
    """Pixels (H, W) that are farther off than LARGEST."""
    return np.abs(found.astype(int) - reference).max(axis=-1) > LARGEST


@pytest.mark.parametrize(
    "scene", [statue_and_mesh, painted_towers, glossy_balls, grove], ids=lambda scene: scene.__name__
)
def test_a_scene_looks_as_it_did(ctx, renderer, scene):
    adapter = ctx.info["GL_RENDERER"]
    if RASTERISER not in adapter:
        complaint = f"pictures are kept for {RASTERISER}, this is {adapter}"
        (pytest.fail if os.environ.get("CI") else pytest.skip)(complaint)
    target = Offscreen(ctx, SIZE, SIZE)
    target.clear(SKY)
    matrices = scene(renderer)
    renderer.draw_ground(*matrices, LEVEL, MEADOW)
    renderer.draw_meshes(*matrices)
    renderer.draw_shadows(*matrices, LEVEL)
    renderer.draw(*matrices)
    found = target.color()[..., :3]
    target.release()
    path = HERE / f"{scene.__name__}.png"
    if os.environ.get("UPDATE_PICTURES"):
        Image.fromarray(np.ascontiguousarray(found)).save(path)
    reference = np.asarray(Image.open(path))
    wrong = difference(found, reference)
    if wrong.sum() > MAY_DIFFER:
        OUTPUT.mkdir(exist_ok=True)
        amplified = np.clip(np.abs(found.astype(int) - reference) * GAIN, 0, 255).astype(np.uint8)
        for kind, pixels in (("reference", reference), ("new", found), ("difference", amplified)):
            Image.fromarray(np.ascontiguousarray(pixels)).save(OUTPUT / f"{scene.__name__}-{kind}.png")
        largest = np.abs(found.astype(int) - reference).max()
        pytest.fail(f"{wrong.sum()} pixels differ by more than {LARGEST}, at most by {largest}: see {OUTPUT}")


def test_the_comparison_sees_darker_and_brighter():
    grey = np.full((4, 4, 3), 100)
    for change, seen in ((-LARGEST - 1, True), (-LARGEST, False), (LARGEST, False), (LARGEST + 1, True)):
        assert difference((grey + change).astype(np.uint8), grey).all() == seen
