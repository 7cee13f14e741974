"""How many draw calls a frame takes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import moderngl


class DrawCalls:
    """A count."""

    def __init__(self):
        self.count = 0


@contextmanager
def counted_draw_calls() -> Iterator[DrawCalls]:
    """Count the draw calls of this process while the block runs.

    Neither OpenGL nor moderngl counts them, and a count that each pass kept of itself would miss what it hands on: so
    moderngl's one way of drawing is watched for as long.
    """
    calls, render = DrawCalls(), moderngl.VertexArray.render

    def counted(array: moderngl.VertexArray, *arguments: Any, **named: Any) -> None:
        calls.count += 1
        render(array, *arguments, **named)

    moderngl.VertexArray.render = counted  # type: ignore[method-assign]
    try:
        yield calls
    finally:
        moderngl.VertexArray.render = render  # type: ignore[method-assign]
