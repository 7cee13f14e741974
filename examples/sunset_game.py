"""Lantern wood, a small game: gather the lanterns before it is night. `python examples/sunset_game.py`

Arrows or WASD walk, escape leaves. The wood, the house and the statue are fans; the walker, the lanterns, the ground
and the sky are the game's own meshes and shaders (sunset_look.py), in the same depth buffer and under the same light.
`--frames N --picture OUT.png` plays without a window, with a walker who finds the way alone.
"""

import argparse
import os
import sys
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
from PIL import Image, ImageOps
from scipy.spatial import KDTree
from sunset_look import BODY, CORNERS, GROUND_VERTICES, LANTERN, LEG, SHADERS, SKY, TUFT

import impostor
from bake.fan import bake_fan
from impostor.views import direction, rotation_about_y
from runtime import Camera, ImpostorRenderer, make_context
from runtime.animation import AnimatedFan, AnimatedInstances

SAMPLES = Path(__file__).resolve().parents[1] / "sample_models"
CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "impostor-lantern-wood"
GROUND = impostor.Ground(np.array([0.0, 1.0, 0.0]))
POSES = 8  # of a tree that sways
DAY = 80.0  # seconds from the afternoon to the night
SUN_AZIMUTH_DEG, MOON_AZIMUTH_DEG, MOON_ELEVATION_DEG = 212, 157, 17
LANTERNS, GRASS, GRASS_REACH = 24, 3600, 20.0
SPEED, TURN = 4.2, 2.2  # metres and radians a second


def fans(cache, views, size):
    """The game's fans by name; baked and kept in the cache folder when they are not there."""
    cache.mkdir(parents=True, exist_ok=True)
    tree, tuft = (
        (lambda: impostor.load_model(SAMPLES / "tree.glb")),
        (lambda: impostor.Model.from_arrays(*TUFT, name="tuft")),
    )
    recipes = {
        f"tree {pose}": (lambda pose=pose: bent(tree(), 0.25, pose / POSES), views, size) for pose in range(POSES)
    }
    recipes |= {
        "pine": (lambda: impostor.load_model(SAMPLES / "pine.obj"), views, size),
        "house": (lambda: impostor.load_model(SAMPLES / "house.glb"), 2 * views, 2 * size),
        "statue": (lambda: impostor.load_model(SAMPLES / "statue.glb"), 2 * views, 2 * size),
        "tuft": (tuft, max(views // 2, 6), max(size // 2, 16)),
    }
    made = {}
    for name, (model, count, side) in recipes.items():
        path = cache / f"{name} {count}x{side}.fan"
        if not path.exists():
            print(f"baking {path}", file=sys.stderr)
            # The walker's camera is low, so the views are.
            impostor.save(path, bake_fan(model(), views=count, size=side, elevation_deg=4))
        made[name] = impostor.load(path)
    return made


def bent(model, reach, phase):
    """The model in the wind: its top, `reach` metres from its place, goes round once a cycle; the twigs go twice."""
    height = model.bounds[1, 1]

    def moved(points):
        turn, share = 2 * np.pi * phase, (points[:, 1:2] / height) ** 2
        around = turn + 0.4 * points[:, :1]
        sway = reach * share * np.hstack([np.cos(around), 0 * around, 0.5 * np.sin(around)])
        flutter = 0.12 * reach * share * np.sin(2 * turn + 5 * points[:, [1, 2, 0]])
        return (points + sway + flutter).astype(np.float32)

    return replace(model, primitives=tuple(replace(part, positions=moved(part.positions)) for part in model.primitives))


class World:
    """What is where, and what happens: no OpenGL."""

    def __init__(self, time=0.0, seed=7):
        rng = np.random.default_rng(seed)
        self.time, self.score = time, 0
        self.place, self.heading, self.stride = np.array([1.2, 0.0, 15.0]), np.pi, 0.0
        self.house, self.statue = np.array([9.5, 0, -13.0]), np.array([-4.2, 0, -3.0])
        spots = rng.uniform(-120, 120, (2600, 2))
        # Of two that are too near to each other the later goes.
        spots = np.delete(spots, KDTree(spots).query_pairs(3.6, output_type="ndarray")[:, 1], axis=0)
        clearing = np.hypot(*spots.T) < 17 + 3 * rng.random(len(spots))
        path = np.abs(spots[:, 0] - 3 * np.sin(0.13 * spots[:, 1])) < 4.5
        garden = np.hypot(*(spots - self.house[[0, 2]]).T) < 9
        trunks = np.insert(spots[~(clearing | path | garden)], 1, 0.0, axis=1)
        # Leafy trees around the clearing, pines farther off.
        leafy = rng.random(len(trunks)) < np.interp(np.hypot(trunks[:, 0], trunks[:, 2]), [17, 45], [0.75, 0.12])
        self.trees, self.pines = trunks[leafy], trunks[~leafy]
        turn, far = rng.uniform(0, 2 * np.pi, 4 * LANTERNS), np.sqrt(rng.uniform(9, 15.5**2, 4 * LANTERNS))
        lanterns = np.stack([far * np.sin(turn), np.full(len(far), 1.15), far * np.cos(turn)], axis=-1)
        walled = np.hypot(*(lanterns - self.house)[:, [0, 2]].T) < 6.5
        self.lanterns = lanterns[~walled & (np.hypot(*(lanterns - self.statue)[:, [0, 2]].T) > 2)][:LANTERNS]
        self.left = np.ones(LANTERNS, bool)

    @property
    def ahead(self):
        """Where the walker looks, (3,)."""
        return direction(self.heading, 0.0)

    def way_to_lantern(self):
        """What keys (walk, turn) lead to the nearest lantern."""
        if not self.left.any():
            return 0.0, 0.0
        offset = self.lanterns[self.left] - self.place
        x, _, z = offset[np.argmin(np.hypot(offset[:, 0], offset[:, 2]))]
        off = (np.arctan2(x, z) - self.heading + np.pi) % (2 * np.pi) - np.pi
        return (1.0 if abs(off) < 0.8 else 0.3), float(np.clip(4 * off, -1, 1))

    def update(self, seconds, walk, turn):
        """Let time pass; `walk` and `turn` are -1 to 1."""
        self.time = min(self.time + seconds / DAY, 1.0)
        self.heading += TURN * turn * seconds
        self.place += SPEED * walk * seconds * self.ahead
        self.stride += 2.1 * walk * seconds * np.pi
        solid = [(self.trees, 0.75), (self.pines, 0.7), (self.statue[None], 0.95), (self.house[None], 5.2)]
        for places, reach in solid:
            off = self.place - places
            near = np.hypot(off[:, 0], off[:, 2])
            for index in np.flatnonzero(near < reach):
                self.place = places[index] + off[index] * (reach / max(near[index], 1e-6))
        reached = self.left & (np.linalg.norm(self.lanterns - self.place - [0, 1.1, 0], axis=1) < 1.2)
        self.left &= ~reached
        self.score += int(reached.sum())

    def camera(self, aspect):
        """Behind the walker and a little above."""
        eye = self.place - 6.2 * self.ahead + [0, 2.35, 0]
        return Camera.perspective(eye, self.place + 3 * self.ahead + [0, 1.55, 0], 50, aspect, 0.3, 400)

    def sky(self):
        """Colours of this time of day by the names of the shaders' uniforms."""
        row = [np.interp(self.time, SKY[:, 0], column) for column in SKY.T]
        sun, moon = np.radians([SUN_AZIMUTH_DEG, row[1]]), np.radians([MOON_AZIMUTH_DEG, MOON_ELEVATION_DEG])
        names = ("sunlight", "moonlight", "ambient", "zenith", "horizon")
        colors = {name: tuple(row[2 + 3 * i : 5 + 3 * i]) for i, name in enumerate(names)}
        # What the sky and the ground behind the viewer throw back; from below the horizon it casts no shadow.
        colors["backlight"] = tuple(0.9 * np.array(colors["ambient"]))
        ways = {"sun": direction(*sun), "moon": direction(*moon), "back": direction(sun[0] + 2.3, -0.05)}
        night = float(np.interp(self.time, [0.62, 0.95], [0, 1]))
        return {name: tuple(way.tolist()) for name, way in ways.items()} | colors | {"night": night}


class Picture:
    """Draws a world into a framebuffer of the caller's."""

    def __init__(self, ctx, world, made):
        self.ctx, rng = ctx, np.random.default_rng(3)
        self.programs = {
            name: ctx.program(vertex_shader=vertex, fragment_shader=fragment)
            for name, (vertex, fragment) in SHADERS.items()
        }
        self.corners, self.glows = ctx.buffer(CORNERS), ctx.buffer(reserve=16 * (LANTERNS + 3), dynamic=True)
        self.sky = ctx.vertex_array(self.programs["sky"], [(self.corners, "2f", "at")])
        glow = [(self.corners, "2f", "corner"), (self.glows, "4f/i", "at")]
        self.glow = ctx.vertex_array(self.programs["glow"], glow)
        self.meshes = {}
        for name, rows in {"ground": GROUND_VERTICES, "body": BODY, "leg": LEG, "lantern": LANTERN}.items():
            layout = [(ctx.buffer(rows.astype("f4")), "3f 3f 4f", "position", "normal", "paint")]
            parts = [
                (key, ctx.vertex_array(self.programs[key], layout, skip_errors=True)) for key in ("mesh", "ground")
            ]
            self.meshes[name] = dict(parts)

        self.renderer = ImpostorRenderer(ctx)
        turns, size = np.arange(12) * np.pi / 6, lambda count, low, high: rng.uniform(low, high, count)
        trees, pines, tuft = world.trees, world.pines, made["tuft"]
        sway = AnimatedFan([made[f"tree {pose}"] for pose in range(POSES)], seconds=4.5)
        self.trees = AnimatedInstances(
            self.renderer,
            sway,
            trees,
            rng.choice(turns, len(trees)),
            size(len(trees), 0.75, 1.25),
            rng.random(len(trees)),
        )
        self.renderer.add(made["pine"], pines, rng.choice(turns, len(pines)), size(len(pines), 0.8, 1.7))
        self.renderer.add(made["house"], world.house, np.radians(-32), 0.9)
        self.renderer.add(made["statue"], world.statue, np.radians(35), 1.25, impostor.Gloss(0.12, 40))
        self.grass = self.renderer.add(tuft, np.zeros((GRASS, 3)), rng.choice(turns, GRASS))
        self.home, self.height = rng.uniform(0, 2 * GRASS_REACH, (GRASS, 2)), rng.uniform(0.5, 1.25, GRASS)

    def draw(self, target, world, seconds):
        """One frame: meshes, ground, shadows, fans, and at last what glows."""
        camera, sky = world.camera(target.width / target.height), world.sky()
        clip_from_view, view_from_world = camera.matrices
        spin, turn = 0.8 * world.time * DAY, rotation_about_y(world.heading)
        lanterns = world.lanterns[world.left] + [0, 0.1, 0] * np.sin(3 * spin + 5 * world.lanterns[world.left, :1])
        hand = world.place + turn @ [0.3, 0.72, 0.28]
        self._tell_shaders(camera, world, sky, np.concatenate([hand[None], lanterns]))
        self._light_fans(sky)
        self._move_grass(world.place)
        self.trees.advance(seconds)

        target.use()
        target.clear(depth=1.0)
        self.ctx.disable(moderngl.DEPTH_TEST | moderngl.BLEND)
        self.sky.render(moderngl.TRIANGLE_STRIP)
        self.ctx.enable(moderngl.DEPTH_TEST)
        for lantern in lanterns:
            self._mesh("lantern", placed(lantern, rotation_about_y(spin)))
        legs = 0.55 * np.sin(world.stride)
        parts = ("body", (0, 0, 0), 0.0), ("leg", (0.12, 0.42, 0), legs), ("leg", (-0.12, 0.42, 0), -legs)
        walker = [(name, placed(world.place + turn @ joint, turn @ pitched(swing))) for name, joint, swing in parts]
        for name, matrix in walker:
            self._mesh(name, matrix)
        self._mesh("lantern", placed(hand - [0, 0.1, 0], 0.8 * turn))
        self._mesh("ground", np.eye(4), "ground")

        self.grass.visible = False
        self.renderer.draw_shadows(clip_from_view, view_from_world, GROUND)
        # The walker's shadow: the mesh, flattened along the light, as ground that the light does not reach.
        self.programs["ground"]["lit"] = 0.0
        for name, matrix in walker:
            self._mesh(name, flattened(sky["sun"] if max(sky["sunlight"]) > 0 else sky["moon"]) @ matrix, "ground")
        self.grass.visible = True
        self.renderer.draw(clip_from_view, view_from_world)

        glows = np.concatenate([hand[None], lanterns])
        self.glows.write(np.hstack([glows, np.full((len(glows), 1), 0.9)]).astype("f4"))
        self.ctx.enable(moderngl.BLEND)
        self.ctx.blend_func = moderngl.ONE, moderngl.ONE
        target.depth_mask = False
        self.glow.render(moderngl.TRIANGLE_STRIP, instances=len(glows))
        target.depth_mask = True
        self.ctx.disable(moderngl.BLEND)

    def _tell_shaders(self, camera, world, sky, lights):
        """Give every program the uniforms it has; the three nearest lanterns light the ground and the walker."""
        clip_from_world = camera.clip_from_view @ camera.view_from_world
        right, up, _ = camera.view_from_world[:3, :3]
        eye = -camera.view_from_world[:3, :3].T @ camera.view_from_world[:3, 3]
        nearest = np.argsort(np.linalg.norm(lights - world.place, axis=1))[:3]
        lamps = np.concatenate([lights[nearest], np.full((3, 3), -1e3)])[:3]
        values = {"clip_from_world": clip_from_world.T, "world_from_clip": np.linalg.inv(clip_from_world).T, **sky}
        values |= {"right": right, "up": up, "eye": eye, "lamps": lamps, "time": world.time * DAY, "lit": 1.0}
        for program in self.programs.values():
            for name in values.keys() & set(program):
                program[name].write(np.ascontiguousarray(values[name], "f4"))

    def _light_fans(self, sky):
        lights = [(sky[name], sky[f"{name}light"]) for name in ("sun", "moon", "back")]
        self.renderer.lights = [impostor.DirectionalLight(*light) for light in lights if max(light[1]) > 0]
        self.renderer.ambient = sky["ambient"]

    def _move_grass(self, place):
        """Grass grows around the walker only: what falls behind comes up again in front."""
        offset = (self.home - place[[0, 2]]) % (2 * GRASS_REACH) - GRASS_REACH
        spots = place[[0, 2]] + offset
        on_path = np.abs(spots[:, 0] - 3 * np.sin(0.13 * spots[:, 1])) < 1.3
        self.grass.positions[:, [0, 2]] = spots
        full = np.clip((GRASS_REACH - np.hypot(*offset.T)) / 6, 0, 1)
        # A copy of no size is left out.
        self.grass.scales[:] = self.height * full * ~on_path

    def _mesh(self, name, world_from_mesh, program="mesh"):
        self.programs[program]["world_from_mesh"].write(np.ascontiguousarray(world_from_mesh.T, "f4"))
        self.meshes[name][program].render()


def placed(place, turn):
    """The matrix (4, 4) of a turn and a place."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, place
    return matrix


def pitched(angle):
    """A turn (3, 3) about x."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])


def flattened(toward):
    """The matrix that casts a shadow just over the ground."""
    matrix = np.eye(4)
    matrix[:3, 1] -= np.array(toward) / max(toward[1], 0.05)
    matrix[1, 3] = 0.012
    return matrix


def play(world, made, size):
    """In a window, until it is closed."""
    import pygame

    pygame.display.init()
    for name, value in (("CONTEXT_MAJOR_VERSION", 3), ("CONTEXT_MINOR_VERSION", 3), ("MULTISAMPLEBUFFERS", 1)):
        pygame.display.gl_set_attribute(getattr(pygame, f"GL_{name}"), value)
    pygame.display.gl_set_attribute(pygame.GL_CONTEXT_PROFILE_MASK, pygame.GL_CONTEXT_PROFILE_CORE)
    pygame.display.gl_set_attribute(pygame.GL_MULTISAMPLESAMPLES, 4)
    pygame.display.gl_set_attribute(pygame.GL_DEPTH_SIZE, 24)
    pygame.display.set_mode(size, pygame.OPENGL | pygame.DOUBLEBUF)
    ctx = moderngl.create_context(require=330)
    picture, clock = Picture(ctx, world, made), pygame.time.Clock()
    while True:
        seconds = min(clock.tick(60) / 1000, 0.1)
        for event in pygame.event.get():
            if event.type == pygame.QUIT or (event.type == pygame.KEYDOWN and event.key == pygame.K_ESCAPE):
                pygame.quit()
                return
        held = pygame.key.get_pressed()
        walk = float(held[pygame.K_UP] or held[pygame.K_w]) - float(held[pygame.K_DOWN] or held[pygame.K_s])
        turn = float(held[pygame.K_LEFT] or held[pygame.K_a]) - float(held[pygame.K_RIGHT] or held[pygame.K_d])
        world.update(seconds, walk, turn)
        picture.draw(ctx.screen, world, seconds)
        pygame.display.set_caption(f"Lantern wood: {world.score} of {LANTERNS} lanterns")
        pygame.display.flip()


def record(world, made, size, frames, step, out):
    """Without a window; the last frame becomes a picture."""
    ctx = make_context()
    screen = ctx.framebuffer([ctx.renderbuffer(size, 4, 4)], ctx.depth_renderbuffer(size, 4))
    flat, picture = ctx.simple_framebuffer(size), Picture(ctx, world, made)
    for _ in range(frames):
        world.update(step, *world.way_to_lantern())
        picture.draw(screen, world, step)
    ctx.copy_framebuffer(flat, screen)
    ImageOps.flip(Image.frombytes("RGB", size, flat.read())).save(out)
    print(f"{out}: {world.score} of {LANTERNS} lanterns after {frames} frames")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, help="play so many frames without a window")
    parser.add_argument("--picture", type=Path, default=Path("lantern_wood.png"), help="the last of them")
    parser.add_argument("--step", type=float, default=1 / 30, help="seconds a frame without a window")
    parser.add_argument("--time", type=float, default=0.0, help="of day: 0 is the afternoon, 1 is the night")
    parser.add_argument("--size", type=int, nargs=2, default=(1280, 720), metavar=("W", "H"))
    parser.add_argument("--views", type=int, default=32, help="of each fan")
    parser.add_argument("--tile", type=int, default=128, help="texels of each view")
    parser.add_argument("--cache", type=Path, default=CACHE, help="folder that keeps the fans")
    given = parser.parse_args()
    world, made = World(given.time), fans(given.cache, given.views, given.tile)
    if given.frames:
        record(world, made, tuple(given.size), given.frames, given.step, given.picture)
    else:
        play(world, made, tuple(given.size))


if __name__ == "__main__":
    main()
