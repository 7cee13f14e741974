"""Impostors in a program with its own OpenGL context: `python examples/embed.py [FAN [OUT.png]]`."""

import sys
from pathlib import Path

import moderngl
import numpy as np
from PIL import Image

import impostor
from bake.fan import bake_fan
from runtime import ImpostorRenderer
from runtime.gl.context import make_context

TREE = Path(__file__).resolve().parents[1] / "sample_models" / "tree.glb"
VERTEX = "#version 330\nuniform mat4 m; in vec2 p; void main() { gl_Position = m * vec4(p.x, 0.0, p.y, 1.0); }"
FRAGMENT = "#version 330\nuniform vec3 color; out vec4 c; void main() { c = vec4(color, 1.0); }"

# What a game has already: a context, a framebuffer (here with MSAA), two camera matrices, a ground.
ctx, (width, height) = make_context(), (640, 360)
screen = ctx.framebuffer([ctx.renderbuffer((width, height), 4, 4)], ctx.depth_renderbuffer((width, height), 4))
picture = ctx.simple_framebuffer((width, height))
focal, near, far, tilt, eye = 2.6, 1.0, 400.0, np.radians(11), np.array([0.0, 15.0, 70.0])
clip_from_view = np.diag([focal * height / width, focal, -(far + near) / (far - near), 0.0])
clip_from_view[2:, 2:] += [[0.0, -2 * far * near / (far - near)], [-1.0, 0.0]]
view_from_world = np.eye(4)
view_from_world[1:3, 1:3] = [[np.cos(tilt), -np.sin(tilt)], [np.sin(tilt), np.cos(tilt)]]
view_from_world[:3, 3] = -view_from_world[:3, :3] @ eye
program = ctx.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT)
program["m"] = (clip_from_view @ view_from_world).T.ravel()
corners = ctx.buffer(np.array([[-300, -300], [300, -300], [-300, 300], [300, 300]], "f4"))
my_ground = ctx.vertex_array(program, [(corners, "2f", "p")])

# One fan, many instances of it.
fan = impostor.load(sys.argv[1]) if len(sys.argv) > 1 else bake_fan(impostor.load_model(TREE), views=32, size=96)
rng = np.random.default_rng(4)
positions = rng.uniform((-60, 0, -120), (60, 0, 46), (200, 3))
renderer = ImpostorRenderer(ctx, cache_side=2048)
trees = renderer.add(fan, positions, yaws=rng.uniform(0, 2 * np.pi, 200), scales=rng.uniform(0.7, 1.2, 200))
renderer.ambient = (0.22, 0.26, 0.34)
frames = []
for azimuth_deg, elevation_deg in ((-70, 18), (-30, 40), (30, 40), (70, 18)):
    sun = impostor.DirectionalLight.from_angles(azimuth_deg, elevation_deg, (1.8, 1.5, 1.1))
    renderer.lights = [sun]
    trees.positions[:, 0] += 2.0
    screen.use()
    screen.clear(0.70, 0.80, 0.90, 1.0)
    ctx.enable(moderngl.DEPTH_TEST)
    program["color"] = (np.array([0.13, 0.19, 0.06]) * (renderer.ambient + sun.toward[1] * np.array(sun.color))) ** 0.45
    my_ground.render(moderngl.TRIANGLE_STRIP)
    renderer.draw_shadows(clip_from_view, view_from_world, impostor.Ground(np.array([0, 1, 0])))
    renderer.draw(clip_from_view, view_from_world)
    ctx.copy_framebuffer(picture, screen)
    frames.append(np.frombuffer(picture.read(), np.uint8).reshape(height, width, 3)[::-1])
renderer.release()

out = Path(sys.argv[2] if len(sys.argv) > 2 else "embed.png")
Image.fromarray(np.vstack([np.hstack(frames[:2]), np.hstack(frames[2:])])).save(out)
print(f"{out}: {len(trees)} trees under four suns")
