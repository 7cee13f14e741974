"""A contact sheet of fans, without a window: `python examples/contact_sheet.py [FAN ...] [-o SHEET.png]`.

A row for each fan, a column for each direction and sun; all drawn into one framebuffer of plain moderngl, cell by
cell, by moving its viewport. Without fans, small ones of four sample models are baked.
"""

import argparse
from pathlib import Path

import numpy as np
from PIL import Image, ImageOps

import impostor
from bake.fan import bake_fan
from runtime import Camera, GroundSurface, ImpostorRenderer, make_context

SAMPLES = Path(__file__).resolve().parents[1] / "sample_models"
NAMES = ("tree.glb", "house.glb", "statue.glb", "truck.glb")
COLUMNS = 6

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("fans", nargs="*", type=Path, metavar="FAN")
parser.add_argument("-o", "--out", type=Path, default=Path("contact_sheet.png"))
parser.add_argument("--cell", type=int, default=220, help="pixels on each side")
given = parser.parse_args()
fans = [impostor.load(path) for path in given.fans]
fans = fans or [bake_fan(impostor.load_model(SAMPLES / name), views=24, size=128) for name in NAMES]

ctx, cell = make_context(), given.cell
size = COLUMNS * cell, len(fans) * cell
sheet = ctx.framebuffer([ctx.renderbuffer(size, 4, 4)], ctx.depth_renderbuffer(size, 4))
sheet.clear(0.93, 0.92, 0.89, 1.0)
for row, fan in enumerate(fans):
    # The renderer lives as long as it is used; the framebuffer and the context stay the caller's.
    renderer = ImpostorRenderer(ctx, cache_side=1024)
    renderer.ambient = (0.26, 0.28, 0.33)
    renderer.add(fan)
    center, radius = fan.bounds.mean(axis=0), fan.radius
    ground = impostor.Ground(np.array([0.0, 1.0, 0.0]), fan.bounds[0, 1])
    # As bright under this light as the paper is, so that the shadows are all one sees of it.
    floor = GroundSurface((0.945, 0.967, 0.945), middle=tuple(center.tolist()), reach=100 * radius)
    for column in range(COLUMNS):
        sheet.viewport = column * cell, (len(fans) - 1 - row) * cell, cell, cell
        sheet.use()
        azimuth_deg = 360 * column / COLUMNS + 20
        camera = Camera.orthographic(center, 1.15 * radius, np.radians(azimuth_deg), np.radians(15))
        sun = impostor.DirectionalLight.from_angles(azimuth_deg - 75 + 30 * column, 42, (0.95, 0.86, 0.72))
        renderer.lights = [sun]
        renderer.draw_ground(*camera.matrices, ground, floor)
        renderer.draw_shadows(*camera.matrices, ground)
        renderer.draw(*camera.matrices)
    renderer.release()
flat = ctx.simple_framebuffer(size)
ctx.copy_framebuffer(flat, sheet)
ImageOps.flip(Image.frombytes("RGB", size, flat.read())).save(given.out)
print(f"{given.out}: {len(fans)} fans from {COLUMNS} sides")
