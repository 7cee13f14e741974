"""What goes up to the GPU: records, pictures in an atlas, and the size of textures."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.errors import GpuError
from impostor.files.fan_manifest import atlas_grid

SRGB8_ALPHA8 = 0x8C43
CORNERS = np.array([[0, 0], [1, 0], [0, 1], [1, 1]], np.float32)  # of a quad, as a strip of two triangles


class InstanceBuffer:
    """A vertex buffer of per-instance records that grows as needed."""

    memory_kind = "instances"

    def __init__(self, ctx: moderngl.Context, dtype: np.dtype, count: int = 64):
        self.buffer = ctx.buffer(reserve=dtype.itemsize * count, dynamic=True)

    def write(self, records: NDArray[Any]) -> None:
        """Upload the records; the buffer's old contents are given up, so the GPU need not wait."""
        self.buffer.orphan(max(records.nbytes, self.buffer.size))
        self.buffer.write(records)

    def release(self) -> None:
        """Free the buffer."""
        self.buffer.release()


def check_texture_size(ctx: moderngl.Context, what: str, width: int, height: int) -> None:
    """Refuse an image that the GPU cannot hold.

    Raises
    ------
    GpuError
    """
    limit = ctx.info["GL_MAX_TEXTURE_SIZE"]
    if max(width, height) > limit:
        raise GpuError(what, f"needs a texture of {width}x{height}; this GPU holds at most {limit}x{limit}")


def tiles_to_atlas(tiles: NDArray[np.generic]) -> NDArray[np.generic]:
    """Lay tiles (V, S, S, ...) out in one image, near-square, row by row; missing tiles are zero."""
    count, size = tiles.shape[:2]
    columns, rows = atlas_grid(count)
    atlas = np.zeros((rows, size, columns, size, *tiles.shape[3:]), tiles.dtype)
    for row in range(rows):
        part = tiles[row * columns : (row + 1) * columns]
        atlas[row, :, : len(part)] = part.swapaxes(0, 1)
    return atlas.reshape(rows * size, columns * size, *tiles.shape[3:])
