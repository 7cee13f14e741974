"""The OpenGL context that the tests share, and the check that each of them leaves nothing behind in it."""

import pytest
from hypothesis import settings

from runtime import ImpostorRenderer
from runtime.gl.context import make_context
from runtime.gl.offscreen import Offscreen
from tests import gl as raw
from tests.gl import gl

# How long an example takes says how busy the machine is.
settings.register_profile("patient", deadline=None)
settings.load_profile("patient")

KINDS = ("Texture", "Buffer", "Framebuffer", "VertexArray", "Renderbuffer", "Sampler", "Program")
FAILED = pytest.StashKey[bool]()


def live_objects():
    """Names of the current context's OpenGL objects, by kind."""
    live = {}
    for kind in KINDS:
        # A driver may take the lowest free name or go on counting.
        free = gl("glCreateProgram") if kind == "Program" else raw.made(f"{kind}s")
        gl("glDeleteProgram", free) if kind == "Program" else raw.deleted(f"{kind}s", free)
        is_live = getattr(raw.LIBRARY, f"glIs{kind}")
        live[kind] = {name for name in range(1, max(free, 100) + 100) if is_live(name) & 0xFF}
    return live


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    report = yield
    item.stash[FAILED] = item.stash.get(FAILED, False) or report.failed
    return report


@pytest.fixture(scope="session")
def context():
    context = make_context()
    yield context
    context.release()


@pytest.fixture(autouse=True)
def leak_check(request):
    """A test that takes `ctx` has it current, and may leave no live object in it and no OpenGL error."""
    if "ctx" not in request.fixturenames:
        yield
        return
    context = request.getfixturevalue("context")
    with context:
        before = live_objects()
        yield
        error = context.error
        if not request.node.stash.get(FAILED, False):
            assert live_objects() == before
            assert error == "GL_NO_ERROR"


@pytest.fixture
def ctx(context):
    return context


@pytest.fixture
def renderer(ctx):
    renderer = ImpostorRenderer(ctx, cache_side=1024)
    yield renderer
    renderer.release()


@pytest.fixture
def screen(ctx):
    screen = Offscreen(ctx, 64, 64)
    screen.clear()
    yield screen
    screen.release()
