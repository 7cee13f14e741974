"""The OpenGL context that the tests share, and the check that each of them leaves nothing behind in it."""

import ctypes

import pytest

from runtime import ImpostorRenderer
from runtime.gpu import make_context
from runtime.offscreen import Offscreen

KINDS = ("Texture", "Buffer", "Framebuffer", "VertexArray", "Program", "Renderbuffer", "Sampler", "Query")
HIGHEST_NAME = 1000
FAILED = pytest.StashKey[bool]()


def live_objects():
    """Names of the current context's OpenGL objects, by kind."""
    library = ctypes.CDLL("libGL.so.1")
    tests = {kind: getattr(library, f"glIs{kind}") for kind in KINDS}
    return {kind: {name for name in range(1, HIGHEST_NAME) if test(name) & 0xFF} for kind, test in tests.items()}


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
