"""Figures of rooms: reflections that line up, materials of fans and meshes, shapes of a room, one turning sky."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from PIL import Image

from docs.studio import SAMPLES, Studio, captioned
from impostor.environment import Environment, Reflection, Room
from impostor.files.environment_file import read_environment
from impostor.model import Material, Model
from runtime.gl.offscreen import Offscreen
from runtime.meshes.bump import Bump
from runtime.renderer import ImpostorRenderer
from runtime.viewing.cameras import Camera
from runtime.walk.cli import ready_scene
from runtime.walk.walk import Walk

STUDY_SIZE = (4.0, 3.0, 6.0)
GOLD = Reflection(strength=1.0, least=0.9, metal=1.0)
WINDOW_VIEW = (0.1, 1.6, 1.9), (0.95, 1.3, -0.6)
WIDE = 460, 340


def room_localised(studio: Studio) -> Image.Image:
    """A ball in the study: as if that were infinitely far, localised, and bumped (chapter's figures 19-1 to 19-6)."""
    environment = study()
    box = Room.box(environment, STUDY_SIZE, (0, 1.5, 0))
    gold = ball((0.9, 0.72, 0.35))
    # An infinitely far room looks the same; what differs is where its reflections are.
    shots = [
        (Room.far(environment), (1.5, 1.3, 0.0), None, "infinitely far: the window keeps its distance"),
        (box, (1.5, 1.3, 0.0), None, "localised: the window is near and lines up"),
        (box, (0.1, 1.3, -0.9), None, "the same room, further from the window"),
        (box, (1.5, 1.3, 0.0), dents(), "bumped"),
    ]
    pictures = []
    for mirrored, at, bump, _ in shots:
        renderer, screen = ImpostorRenderer(studio.ctx, cache_side=256), Offscreen(studio.ctx, *WIDE, samples=2)
        camera = Camera.perspective(*WINDOW_VIEW, 55, WIDE[0] / WIDE[1], 0.05, 20).matrices
        renderer.lights, renderer.ambient, renderer.rooms = (), 0.0, [box]
        mesh = renderer.add_mesh(gold, placed(at, 0.4), reflection=GOLD, bump=bump)
        screen.clear((0, 0, 0, 1))
        renderer.draw_rooms(*camera)
        renderer.rooms = [mirrored]
        renderer.draw_meshes(*camera)
        pictures.append(Image.fromarray(screen.color()[..., :3]))
        renderer.remove(mesh)
        renderer.release()
        screen.release()
    captions = [text for *_, text in shots]
    return captioned([pictures[:2], pictures[2:]], [captions[:2], captions[2:]])


def room_materials(studio: Studio) -> Image.Image:
    """The statue's fan beside its mesh: matt, lacquered, rough metal and a mirror, in the meadow and in the study."""
    materials = {
        "matt": None,
        "lacquer": Reflection(least=0.08, roughness=0.1),
        "rough metal": replace(GOLD, roughness=0.45),
        "polished metal": replace(GOLD, roughness=0.2),
    }
    meadow = Room.far(read_environment(SAMPLES / "environments" / "meadow.exr"), exposure=0.6)
    rooms = {"meadow": meadow, "study": Room.box(study(), STUDY_SIZE, (0, 1.5, 0))}
    rows, captions = [], []
    for name, room in rooms.items():
        for kind in ("fan", "mesh"):
            rows.append([_statue(studio, room, reflection, kind) for reflection in materials.values()])
            captions.append([f"{material}, {kind}, {name}" for material in materials])
    return captioned(rows, captions)


def room_shapes(studio: Studio) -> Image.Image:
    """The study drawn on a box from its middle and off it, on a sphere and on a cylinder (figure 19-10)."""
    renderer, screen = ImpostorRenderer(studio.ctx, cache_side=256), Offscreen(studio.ctx, *WIDE, samples=2)
    room = Room.box(study(), STUDY_SIZE, (0, 1.5, 0))
    too_large = Room.box(study(), (5.5, 3.0, 6.0), (0, 1.5, 0))
    middle, aside = (0.0, 1.5, 0.0), (-0.9, 1.2, 1.6)
    shots = [
        (room, "box", aside, "its own box, off its middle: as it is"),
        (too_large, "box", aside, "a box too wide: the ceiling bends"),
        (room, "sphere", middle, "a sphere, from the middle: as it is"),
        (room, "sphere", aside, "a sphere, off the middle: it bends"),
        (room, "cylinder", aside, "an upright cylinder"),
        (room, "plane", aside, "a plane at the back: nothing else"),
    ]
    pictures = []
    for drawn, shape, eye, _ in shots:
        renderer.rooms = [drawn]
        camera = Camera.perspective(eye, np.add(eye, (0.35, -0.05, -1)), 75, WIDE[0] / WIDE[1], 0.05, 20).matrices
        screen.clear((0.1, 0.1, 0.1, 1))
        renderer.draw_room_on(*camera, drawn, shape)
        pictures.append(Image.fromarray(screen.color()[..., :3]))
    renderer.release()
    screen.release()
    captions = [text for *_, text in shots]
    return captioned([pictures[at : at + 2] for at in (0, 2, 4)], [captions[at : at + 2] for at in (0, 2, 4)])


def room_day(studio: Studio) -> Image.Image:
    """One scene under one panorama that turns: fans, a mesh, a PTM, the ground and its shadows follow."""
    scene = ready_scene(SAMPLES.parent / "scenes" / "meadow.toml")
    walk = Walk(studio.ctx, scene, (700, 394), 4)
    pictures, turns = [], (0, 80, 160, 240)
    for _ in turns:
        walk.draw()
        pictures.append(Image.fromarray(walk.picture()))
        walk.sun.drag(-np.radians(80), 0.0)
    walk.release()
    captions = [f"turned by {turn} degrees" for turn in turns]
    return captioned([pictures[:2], pictures[2:]], [captions[:2], captions[2:]])


def room_sky(studio: Studio) -> Image.Image:
    """One scene through a day: the sun goes, and the clear sky with it."""
    walk = Walk(studio.ctx, ready_scene(SAMPLES.parent / "scenes" / "day.toml"), (700, 394), 4)
    pictures, captions = [], ("at 7", "at noon", "at 18:30", "at 20")
    for hours in (0.0, 5.0, 6.5, 1.5):
        walk.sun.turn_clock(hours)
        walk.draw()
        pictures.append(Image.fromarray(walk.picture()))
    walk.release()
    return captioned([pictures[:2], pictures[2:]], [captions[:2], captions[2:]])


def room_study(studio: Studio) -> Image.Image:
    """The scene of the study: a statue of gold and a polished knot in a room."""
    walk = Walk(studio.ctx, ready_scene(SAMPLES.parent / "scenes" / "study.toml"), (1000, 500), 4)
    walk.draw()
    picture = Image.fromarray(walk.picture())
    walk.release()
    return picture


def study() -> Environment:
    """The sample room's environment."""
    return read_environment(SAMPLES / "environments" / "study.exr")


def ball(color: Sequence[float], rings: int = 64) -> Model:
    """A sphere of radius 1 with a linear albedo, and texture coordinates that repeat around it."""
    down, around = np.meshgrid(
        np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, 2 * rings + 1), indexing="ij"
    )
    normals = np.stack([np.sin(down) * np.sin(around), np.cos(down), np.sin(down) * np.cos(around)], axis=-1)
    first = (np.arange(rings)[:, None] * (2 * rings + 1) + np.arange(2 * rings)).ravel()
    below = first + 2 * rings + 1
    triangles = np.concatenate(
        [np.stack([first, below, first + 1], axis=-1), np.stack([first + 1, below, below + 1], axis=-1)]
    )
    uvs = np.stack([around / np.pi * 5, down / np.pi * 5], axis=-1).reshape(-1, 2)
    red, green, blue = color
    points = normals.reshape(-1, 3)
    return Model.from_arrays(points, triangles, points, uvs=uvs, material=Material(base_color=(red, green, blue, 1.0)))


def dents(size: int = 256) -> Bump:
    """A pattern of round dents."""
    across = (np.arange(size) + 0.5) / size * 2 - 1
    x, y = np.meshgrid(across, across)
    radius = np.hypot(x, y)
    slope = np.where(radius < 0.7, 0.55 * np.sin(np.pi * radius / 0.7), 0) / np.maximum(radius, 1e-6)
    picture = np.stack([-x * slope, y * slope, np.zeros_like(x)], axis=-1)
    return Bump(np.clip(np.rint(picture * 127 + 128), 0, 255).astype(np.uint8), bumpiness=1.0)


def placed(at: Sequence[float], scale: float) -> np.ndarray:
    """(4, 4): somewhere, at some size."""
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = at
    return matrix


def _statue(studio: Studio, room: Room, reflection: Reflection | None, kind: str) -> Image.Image:
    width, height = 240, 400
    renderer, screen = ImpostorRenderer(studio.ctx, cache_side=2048), Offscreen(studio.ctx, width, height, samples=2)
    camera = Camera.perspective((-0.5, 1.25, 2.1), (0.55, 0.85, -0.8), 27, width / height, 0.05, 50).matrices
    renderer.lights, renderer.ambient, renderer.rooms = (), 0.0, [room]
    if kind == "fan":
        renderer.add(studio.fan("statue", size=512), (0.55, 0, -0.8), 0.0, 0.7, reflection=reflection)
    else:
        renderer.add_mesh(studio.model("statue"), placed((0.55, 0, -0.8), 0.7), reflection=reflection)
    screen.clear((0, 0, 0, 1))
    renderer.draw_rooms(*camera)
    renderer.draw_meshes(*camera)
    renderer.draw(*camera)
    picture = Image.fromarray(screen.color()[..., :3])
    renderer.release()
    screen.release()
    return picture
