"""The caller's OpenGL state: no pass relies on it, and every pass leaves it as it was."""

import gc

import numpy as np
import pytest

from impostor.environment import Environment, Reflection, Room
from impostor.errors import SettingsError
from impostor.lighting import DirectionalLight, Gloss, LocalLight
from impostor.shadow_projection import Ground
from runtime import ImpostorRenderer
from runtime.gl.context import make_context
from runtime.gl.offscreen import Offscreen
from runtime.ground.ground_pass import GroundSurface
from runtime.meshes.bump import Bump
from runtime.surfaces.surface_pass import rectangle
from runtime.viewing.cameras import Camera
from tests import gl as raw
from tests.conftest import live_objects
from tests.gl import gl
from tests.ptms import random_ptm
from tests.solids import BLUE, Box, Sphere, solid_fan, solid_model

LEVEL = Ground((0, 1, 0))
FAN = solid_fan(Sphere((0, 1, 0)), views=6, size=32, elevation_deg=20)
PAINTED = solid_fan(Sphere((0, 1, 0)), Box((-1, 0, -1), (1, 0.5, 1), BLUE), views=6, size=32, elevation_deg=20)
MODEL = solid_model(Box((-0.5, 0, -0.5), (0.5, 1.5, 0.5)))
LIGHTS = [DirectionalLight.from_angles(30, 50, (0.6, 0.5, 0.4)), DirectionalLight.from_angles(-60, 40, (0.3, 0.3, 0.4))]
CAMERA = Camera.perspective((0, 5, 9), (0, 0.7, 0), 45, 1, 1, 40)
MATRICES = (CAMERA.clip_from_view, CAMERA.view_from_world)
PTM = random_ptm(size=(16, 16))
LIGHT = np.random.default_rng(0).uniform(0, 1, (6, 8, 8, 3))
ROOMS = [Room.box(Environment("box", LIGHT), (7, 6, 9), (0, 2, 0)), Room.far(Environment("sky", LIGHT[::-1]))]
MIRROR, BUMP = Reflection(least=0.3, roughness=0.2), Bump(np.full((2, 2, 3), (90, 150, 255), np.uint8))
CARD = rectangle(1, 1)
SURFACE = GroundSurface(texture=np.full((3, 5, 4), 200, np.uint8))
CALLS = {
    "ground": lambda renderer: renderer.draw_ground(*MATRICES, LEVEL, SURFACE),
    "shadows": lambda renderer: renderer.draw_shadows(*MATRICES, LEVEL),
    "shadows on a surface": lambda renderer: renderer.draw_shadows(*MATRICES, renderer._placed.surfaces[0]),
    "meshes": lambda renderer: renderer.draw_meshes(*MATRICES),
    "surfaces": lambda renderer: renderer.draw_surfaces(*MATRICES),
    "rooms": lambda renderer: renderer.draw_rooms(*MATRICES),
    "a room on something": lambda renderer: renderer.draw_room_on(*MATRICES, ROOMS[0], "cylinder"),
    "fans": lambda renderer: renderer.draw(*MATRICES),
    "albedo": lambda renderer: renderer.draw(*MATRICES, output="albedo"),
    "normals": lambda renderer: renderer.draw(*MATRICES, output="normal"),
    "add": lambda renderer: renderer.add(FAN, (0, 0, 3), gloss=Gloss(0.2)),
    "add a mesh": lambda renderer: renderer.add_mesh(MODEL),
    "add bumps": lambda renderer: renderer.add_mesh(CARD, bump=BUMP),
    "take away": lambda renderer: [
        renderer.remove(each)
        for each in (
            *renderer._placed.surfaces,
            *renderer._placed.meshes,
            *(x.instances for x in renderer._placed.batches),
        )
    ],
    "add a surface": lambda renderer: renderer.add_surface(PTM, rectangle(1, 1)),
}
PICTURE = ("ground", "surfaces", "shadows", "shadows on a surface", "meshes", "fans", "rooms")


def everything(placed):
    return [*placed.surfaces, *placed.meshes, *(batch.instances for batch in placed.batches)]


def scene(renderer):
    renderer.lights = LIGHTS
    renderer.add(FAN, [(-2, 0, 0), (2, 0, -1)], 0.3)
    renderer.add(PAINTED, (0, 0, -2), gloss=Gloss(0.5))
    renderer.rooms = ROOMS
    renderer.add_mesh(MODEL)
    renderer.add_mesh(CARD, matrix_at(2, 1, 2), reflection=MIRROR, bump=BUMP)
    renderer.add_surface(PTM, rectangle(2, 2), world_from_model=matrix_at(0, 1, -3))
    renderer.local_lights = [LocalLight((0, 1, -2))]


def matrix_at(x, y, z):
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


@pytest.fixture
def caller(ctx, screen):
    """Objects of a caller's own, bound where they would do harm; all is put right again at the end."""
    kinds = ("Textures", "Samplers", "Buffers", "VertexArrays")
    textures, sampler, buffer, vertices = names = [raw.made(kind) for kind in kinds]
    vertex = "#version 330\nvoid main() { gl_Position = vec4(0.0); }"
    fragment = "#version 330\nout vec4 color;\nvoid main() { color = vec4(1.0); }"
    program = ctx.program(vertex_shader=vertex, fragment_shader=fragment)

    def bind():
        raw.set_askew([textures], sampler)
        gl("glBindVertexArray", vertices)
        gl("glBindBuffer", 0x8892, buffer)
        gl("glUseProgram", program.glo)

    yield bind
    raw.set_plain()
    for kind, name in zip(kinds, names, strict=True):
        raw.deleted(kind, name)
    program.release()


def test_the_checks_see_every_change(caller):
    """Or the tests below would pass for want of looking."""
    before = raw.snapshot()
    caller()
    after = raw.snapshot()
    changed = {name for name in before if before[name] != after[name]}
    assert len(changed) > 35
    assert {"CULL_FACE_MODE", "BLEND_EQUATION_RGB", "COLOR_CLEAR_VALUE", "unit 5", "unit 31", "ARRAY_BUFFER"} <= changed


@pytest.mark.parametrize("call", CALLS)
@pytest.mark.parametrize("first", [True, False], ids=["first call", "later call"])
def test_every_call_leaves_the_state_as_it_was(renderer, screen, caller, call, first):
    scene(renderer)
    if not first:
        CALLS[call](renderer)
        renderer.lights = LIGHTS[:1]
    caller()
    gl("glViewport", 3, 5, 40, 50)
    gl("glEnable", raw.SWITCHES["SCISSOR_TEST"])
    gl("glScissor", 7, 9, 20, 21)
    gl("glColorMask", 1, 0, 1, 0)
    before = raw.snapshot()
    CALLS[call](renderer)
    assert raw.snapshot() == before


def test_making_and_freeing_a_renderer_leaves_the_state_as_it_was(ctx, screen, caller):
    caller()
    before = raw.snapshot()
    renderer = ImpostorRenderer(ctx, cache_side=256)
    assert raw.snapshot() == before
    scene(renderer)
    for name in PICTURE:
        CALLS[name](renderer)
    renderer.release()
    assert raw.snapshot() == before


@pytest.mark.parametrize(
    ("draw", "error"),
    [
        (lambda renderer: renderer.draw(np.eye(3), np.eye(4)), SettingsError),
        (lambda renderer: renderer.draw_shadows(np.zeros((4, 4)), np.eye(4), LEVEL), SettingsError),
        (lambda renderer: renderer.draw_ground(*MATRICES, LEVEL, GroundSurface(albedo=(1, "red", 1))), Exception),
        (lambda renderer: renderer.draw_meshes(*MATRICES, output="lid"), SettingsError),
        (lambda renderer: renderer.draw(*MATRICES, output="lid"), SettingsError),
    ],
    ids=["shape", "singular", "albedo", "mesh output", "fan output"],
)
def test_a_call_that_fails_leaves_the_state_as_it_was(renderer, screen, caller, draw, error):
    scene(renderer)
    caller()
    before = raw.snapshot()
    with pytest.raises(error):
        draw(renderer)
    assert raw.snapshot() == before


def draw_all(renderer, screen):
    for name in PICTURE:
        CALLS[name](renderer)
    return screen.color()


def test_no_pass_relies_on_the_callers_state(renderer, screen, caller):
    """The picture drawn under a state that is all askew is the one drawn under the default state."""
    scene(renderer)
    raw.set_plain()
    screen.clear((0.2, 0.3, 0.4, 1))
    expected, depth = draw_all(renderer, screen), screen.depth()
    other = ImpostorRenderer(renderer._ctx, cache_side=1024)
    try:
        screen.clear((0.2, 0.3, 0.4, 1))
        caller()
        scene(other)
        found = draw_all(other, screen)
    finally:
        raw.set_plain()
        other.release()
    assert len(np.unique(expected[..., 0])) > 20
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(screen.depth(), depth)


def test_a_scissor_box_and_a_colour_mask_are_kept_to(renderer, screen, caller):
    scene(renderer)
    raw.set_plain()
    screen.clear((0.2, 0.3, 0.4, 1))
    whole = draw_all(renderer, screen)
    screen.clear((0.2, 0.3, 0.4, 1))
    background = screen.color()
    screen.framebuffer.use()
    gl("glEnable", raw.SWITCHES["SCISSOR_TEST"])
    gl("glScissor", 10, 20, 30, 25)
    gl("glColorMask", 1, 0, 1, 1)
    found = draw_all(renderer, screen)
    inside = np.zeros((64, 64), bool)
    inside[64 - 45 : 64 - 20, 10:40] = True
    np.testing.assert_array_equal(found[~inside], background[~inside])
    np.testing.assert_array_equal(found[..., 1], background[..., 1])
    np.testing.assert_array_equal(found[inside][:, [0, 2]], whole[inside][:, [0, 2]])


def test_a_framebuffer_that_moderngl_does_not_know(ctx, renderer, screen):
    """A caller who binds with OpenGL's own functions gets the picture there."""
    scene(renderer)
    expected = draw_all(renderer, screen)
    name, color, depth = raw.made("Framebuffers"), ctx.texture((64, 64), 4), ctx.depth_texture((64, 64))
    gl("glBindFramebuffer", 0x8D40, name)
    gl("glFramebufferTexture2D", 0x8D40, 0x8CE0, 0x0DE1, color.glo, 0)
    gl("glFramebufferTexture2D", 0x8D40, 0x8D00, 0x0DE1, depth.glo, 0)
    gl("glViewport", 0, 0, 64, 64)
    gl("glClear", 0x4100)
    before = raw.snapshot()
    for call in PICTURE:
        CALLS[call](renderer)
    assert raw.snapshot() == before
    found = np.frombuffer(color.read(), np.uint8).reshape(64, 64, 4)[::-1]
    screen.framebuffer.use()
    raw.deleted("Framebuffers", name)
    color.release()
    depth.release()
    np.testing.assert_array_equal(found, expected)


def test_a_caller_who_released_the_bound_framebuffer(ctx, renderer, screen):
    scene(renderer)
    expected = draw_all(renderer, screen)
    gone = ctx.framebuffer([ctx.texture((8, 8), 4)])
    gone.use()
    gone.color_attachments[0].release()
    gone.release()
    renderer.draw(*MATRICES)
    assert ctx.error  # there was nothing to draw into
    screen.clear()
    np.testing.assert_array_equal(draw_all(renderer, screen), expected)


def test_a_second_context_in_the_same_process(context, ctx, renderer, screen):
    scene(renderer)
    expected = draw_all(renderer, screen)
    other = make_context()
    try:
        theirs, picture = ImpostorRenderer(other, cache_side=1024), Offscreen(other, 64, 64)
        picture.clear()
        scene(theirs)
        found = draw_all(theirs, picture)
        theirs.release()
        picture.release()
        assert not any(live_objects().values())
    finally:
        other.release()
        context.__enter__()
    np.testing.assert_array_equal(found, expected)
    screen.clear()
    np.testing.assert_array_equal(draw_all(renderer, screen), expected)


def test_nothing_is_left_on_the_gpu(ctx, screen):
    screen.clear()
    before = live_objects()
    renderer = ImpostorRenderer(ctx, cache_side=256)
    scene(renderer)
    for lights in (LIGHTS, [], LIGHTS * 3):
        renderer.lights = lights
        for call in CALLS.values():
            call(renderer)
    assert sum(map(len, live_objects().values())) > sum(map(len, before.values())) + 20
    renderer.release()
    gc.collect()
    assert live_objects() == before


def test_what_is_taken_away_is_freed(ctx, renderer, screen):
    """Fans and meshes that come and go do not add up."""

    def visit():
        placed = [renderer.add(FAN), renderer.add(PAINTED, [(1, 0, 1)] * 3), renderer.add(FAN, (3, 0, 0))]
        meshes = [renderer.add_mesh(MODEL), renderer.add_mesh(CARD, matrix_at(2, 0, 0), reflection=MIRROR, bump=BUMP)]
        renderer.rooms = ROOMS
        for call in ("ground", "shadows", "meshes", "rooms", "fans", "normals"):
            CALLS[call](renderer)
        for each in placed + meshes:
            renderer.remove(each)
        renderer.rooms = ()
        renderer.draw_rooms(*MATRICES)

    visit()
    after_one = live_objects()
    visit()
    assert live_objects() == after_one
    screen.clear()
    renderer.draw(*MATRICES)
    renderer.draw_shadows(*MATRICES, LEVEL)
    assert not screen.color().any()


def test_copies_that_stay_keep_what_they_share(renderer, screen):
    scene(renderer)
    expected = draw_all(renderer, screen)
    extra, mesh = renderer.add(FAN, (0, 0, 5)), renderer.add_mesh(MODEL, matrix_at(3, 0, 3))
    draw_all(renderer, screen)
    renderer.remove(extra)
    renderer.remove(mesh)
    screen.clear()
    np.testing.assert_array_equal(draw_all(renderer, screen), expected)


def test_a_renderer_may_be_released_twice(ctx):
    renderer = ImpostorRenderer(ctx, cache_side=256)
    renderer.add(FAN)
    renderer.release()
    renderer.release()
