"""What a renderer holds on the GPU: counted whole, and no more of it for more copies or more frames."""

import numpy as np
import pytest

from impostor.shadow_projection import Ground
from runtime.fans.textures import FanTextures
from runtime.gl.memory import memory_held
from runtime.gl.offscreen import Offscreen
from runtime.renderer import ImpostorRenderer
from runtime.viewing.cameras import Camera
from tests.solids import GREY, RED, Box, solid_fan, solid_model

BOX = Box((-0.5, 0, -0.5), (0.5, 2, 0.5), RED)
GROUND = Ground(np.array([0.0, 1.0, 0.0]))
BYTES_A_COPY = 27 * 4 + 4 + (4 + 2 + 16) * 4
"""Of the quad, its share, and as a caster."""


@pytest.fixture(scope="module")
def fan():
    return solid_fan(BOX, views=8, size=32)


def crowd(renderer, fan, count):
    random = np.random.default_rng(0)
    return renderer.add(fan, random.uniform(-20, 20, (count, 3)) * (1, 0, 1), random.uniform(0, 2 * np.pi, count))


def draw(renderer, step):
    camera = Camera.perspective((0.1 * step, 3, 30), (0.1 * step, 0, 0), 60, 1, 0.5, 200)
    renderer.draw_shadows(*camera.matrices, GROUND)
    renderer.draw(*camera.matrices)


def test_a_fan_takes_what_its_layers_take(ctx, fan):
    textures = FanTextures(ctx, fan)
    width, height = textures.normal.size
    coloured = textures.color is not None
    # Code and coverage, depth without mip levels, colour.
    expected = width * height * (2 * 4 / 3 + 2 + (4 * 4 / 3 if coloured else 0))
    held = memory_held(textures)
    assert held["fans"] == pytest.approx(expected, abs=2) and sum(held.values()) == held["fans"]
    textures.release()


def test_copies_add_nothing_but_their_records(renderer, screen, fan):
    few, many = ImpostorRenderer(renderer._ctx, cache_side=1024), renderer
    crowd(few, fan, 100)
    crowd(many, fan, 5000)
    for each in (few, many):
        draw(each, 0)
    less, more = few.memory, many.memory
    assert many.statistics["instances"] > 10 * few.statistics["instances"]
    for kind in ("fans", "tile cache", "colormaps", "shadow marks"):
        assert less[kind] == more[kind] > 0
    assert 0 < more["instances"] - less["instances"] <= 5000 * BYTES_A_COPY
    few.release()


def test_frames_add_nothing_but_strips_of_views_not_seen_before(renderer, screen, fan):
    crowd(renderer, fan, 500)
    for step in range(50):
        draw(renderer, step)
        if step == 0:
            first = renderer.memory
    last = renderer.memory
    assert renderer.statistics["relit"] > 0
    strips = last.pop("shadow strips") - first.pop("shadow strips")
    # At most one for each view and level: a quarter of the texels of the finest, at 24 bytes a corner.
    assert 0 <= strips <= len(fan.views) * 4 * fan.size**2
    growth = {kind: last[kind] - first[kind] for kind in last}
    assert growth.pop("instances") <= 500 * BYTES_A_COPY and not any(growth.values())


def test_what_is_removed_is_not_held(renderer, screen, fan):
    before = renderer.memory
    copies, mesh = crowd(renderer, fan, 3), renderer.add_mesh(solid_model(Box((0, 0, 0), (1, 1, 1), GREY)))
    draw(renderer, 0)
    held = renderer.memory
    assert held["fans"] > 0 and held["meshes"] > 0 and held["shadow strips"] > 0
    renderer.remove(copies)
    renderer.remove(mesh)
    after = renderer.memory
    assert after["fans"] == before["fans"] == after["meshes"] == after["shadow strips"] == 0


def test_a_picture_counts_its_samples(ctx):
    offscreen = Offscreen(ctx, 64, 32)
    plain = sum(memory_held(offscreen).values())
    assert plain >= 64 * 32 * 4
    offscreen.release()
