"""The face table: where directions land, in NumPy and in OpenGL, and that no seam shows."""

import itertools

import moderngl
import numpy as np
import pytest

from impostor.environment import cube
from runtime.gl.state import preserved_state
from tests.gl import SWITCHES, gl

CORNERS = np.array(list(itertools.product((-1, 1), repeat=3)), float)
EDGES = np.array([corner for corner in itertools.product((-1, 0, 1), repeat=3) if corner.count(0) == 1], float)


@pytest.fixture(scope="module")
def noise():
    return np.random.default_rng(5).random((6, 8, 8, 4), np.float32)


def around(directions, reach, count=40):
    """Many directions near each of some."""
    offsets = np.random.default_rng(6).uniform(-reach, reach, (count, 1, 3))
    return (directions + offsets).reshape(-1, 3)


@pytest.mark.parametrize(
    ("face", "row", "column", "toward"),
    [
        (0, 0, 0, (1, 1, 1)),
        (1, 0, 0, (-1, 1, -1)),
        (2, 0, 0, (-1, 1, -1)),
        (3, 0, 0, (-1, -1, 1)),
        (4, 0, 0, (-1, 1, 1)),
        (5, 0, 0, (1, 1, -1)),
        (0, -1, -1, (1, -1, -1)),
        (2, -1, -1, (1, 1, 1)),
        (5, -1, -1, (-1, -1, -1)),
    ],
)
def test_the_corners_of_the_table_are_opengls(face, row, column, toward):
    corner = cube.face_directions(64)[face, row, column]
    assert np.dot(corner, toward) / np.sqrt(3) > 0.999


@pytest.mark.parametrize("size", [1, 2, 8, 32])
def test_every_texel_is_found_at_its_own_direction(size):
    faces, places = cube.faces_of(cube.face_directions(size) * 7)
    assert np.array_equal(faces, np.broadcast_to(np.arange(6)[:, None, None], (6, size, size)))
    across = (np.arange(size) + 0.5) / size * 2 - 1
    assert np.allclose(places[..., 0], across)
    assert np.allclose(places[..., 1], across[:, None])


@pytest.mark.parametrize("size", [1, 2, 7, 256])
def test_solid_angles_fill_the_sphere(size):
    angles = cube.solid_angles(size)
    assert angles.sum() == pytest.approx(4 * np.pi / 6, rel=1e-12)
    assert angles.min() > 0
    # A texel's own: area seen at its distance and slant.
    x, y = np.meshgrid(*[(np.arange(size) + 0.5) * (2 / size) - 1] * 2)
    if size == 256:
        assert np.allclose(angles, (2 / size) ** 2 / (1 + x**2 + y**2) ** 1.5, rtol=1e-4)


def test_a_look_at_a_texels_middle_gives_the_texel(noise):
    assert np.allclose(cube.sample(noise, cube.face_directions(8)), noise, atol=1e-6)


@pytest.mark.parametrize("places", [EDGES, CORNERS], ids=["edges", "corners"])
def test_looks_are_continuous_across_edges_and_corners(places, noise):
    """A step of 1e-6 changes nothing that noise of full contrast would show at a seam."""
    here = around(places, 1e-6)
    there = np.repeat(places[None], 40, axis=0).reshape(-1, 3)
    assert len(places) in (8, 12)
    assert np.abs(cube.sample(noise, here) - cube.sample(noise, there)).max() < 1e-4


def test_a_linear_field_is_read_as_such():
    slope = np.array([0.3, -0.5, 0.8])
    faces = (cube.face_directions(64) @ slope)[..., None]
    directions = around(np.zeros((1, 3)), 1, 500)
    expected = directions @ slope / np.linalg.norm(directions, axis=-1)
    assert np.abs(cube.sample(faces, directions)[:, 0] - expected).max() < 5e-3


@pytest.mark.usefixtures("screen")
def test_opengl_reads_the_same_from_a_real_cube_map(ctx, noise):
    """All over the sphere, at edges and at corners."""
    directions = np.concatenate([around(EDGES, 0.1), around(CORNERS, 0.1), around(np.zeros((1, 3)), 1, 3000)])
    directions = directions[: len(directions) // 64 * 64].astype(np.float32)
    assert np.abs(read_by_opengl(ctx, noise, directions) - cube.sample(noise, directions)).max() < 4e-3


def read_by_opengl(ctx, faces, directions):
    height = len(directions) // 64
    program = ctx.program(
        """
        #version 330
        void main() { gl_Position = vec4(vec2(gl_VertexID % 2, gl_VertexID / 2) * 4.0 - 1.0, 0.0, 1.0); }
        """,
        """
        #version 330
        uniform samplerCube faces;
        uniform sampler2D directions;
        out vec4 color;
        void main() { color = textureLod(faces, texelFetch(directions, ivec2(gl_FragCoord.xy), 0).xyz, 0.0); }
        """,
    )
    cube_map = ctx.texture_cube((8, 8), 4, faces.tobytes(), dtype="f4")
    cube_map.filter = moderngl.LINEAR, moderngl.LINEAR
    asked = ctx.texture((64, height), 3, directions.tobytes(), dtype="f4")
    asked.filter = moderngl.NEAREST, moderngl.NEAREST
    target = ctx.texture((64, height), 4, dtype="f4")
    framebuffer, array = ctx.framebuffer(target), ctx.vertex_array(program, [])
    with preserved_state(ctx):
        program["directions"] = 1
        framebuffer.use()
        cube_map.use(0)
        asked.use(1)
        gl("glEnable", SWITCHES["TEXTURE_CUBE_MAP_SEAMLESS"])
        array.render(moderngl.TRIANGLES, vertices=3)
        gl("glDisable", SWITCHES["TEXTURE_CUBE_MAP_SEAMLESS"])
    read = np.frombuffer(target.read(), np.float32).reshape(-1, 4)
    for part in (array, framebuffer, target, asked, cube_map, program):
        part.release()
    return read


def test_fewer_texels_hold_the_same_light_at_the_same_place():
    faces = np.random.default_rng(7).random((6, 16, 16, 3))
    faces[4, 3, 5] = 5000
    light, toward = cube.reduced(faces, 4)
    assert np.allclose(light.sum(axis=(0, 1, 2)), (faces * cube.solid_angles(16)[..., None]).sum(axis=(0, 1, 2)))
    assert np.allclose(np.linalg.norm(toward, axis=-1), 1)
    assert np.allclose(toward[4, 0, 1], cube.face_directions(16)[4, 3, 5], atol=1e-2)


def test_what_is_dark_still_has_a_direction():
    light, toward = cube.reduced(np.zeros((6, 8, 8, 3)), 4)
    assert not light.any()
    assert np.allclose((toward * cube.face_directions(4)).sum(axis=-1), 1, atol=1e-2)
