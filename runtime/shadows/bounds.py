"""Where shadows can be on the screen, found from bounding boxes before anything is drawn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from impostor.lighting import DirectionalLight
from impostor.shadow_projection import Ground, along_light

CELL = 32
EDGE = 2


def box_corners(low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.float64]:
    """The eight corners (8, 3) of a box."""
    return np.where(np.indices((2, 2, 2)).reshape(3, 8).T == 1, high, low)


def shadow_hulls(
    corners: NDArray[np.float64], world_from_shadow: NDArray[np.float64], light: DirectionalLight, ground: Ground
) -> NDArray[np.float64]:
    """Points whose hulls hold the shadows of boxes.

    Parameters
    ----------
    corners : ndarray, (N, 8, 3) float64
        Of the boxes, world space.
    world_from_shadow : ndarray, (N, 4, 4) float64
        From the true shadow on the ground to where it is shown, homogeneous.
    light : DirectionalLight
    ground : Ground

    Returns
    -------
    ndarray, (N, 8, 4) float64
        World space, homogeneous: the corners' shadows, `along_light`.
    """
    points = along_light(corners, light.toward, ground)
    return points @ world_from_shadow[:, :, :3].swapaxes(1, 2) + world_from_shadow[:, None, :, 3]


def in_view(hulls: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which hulls (N, K, 4), clip space, may reach into the picture: not all of their points beyond one clip plane.

    So, too, which may reach into any box, in a space where it lies between -1 and 1.
    """
    w = hulls[..., 3:]
    beyond = np.concatenate([hulls[..., :3] > w, hulls[..., :3] < -w], axis=-1)
    return ~np.any(np.all(beyond, axis=1), axis=-1)


def covered_cells(hulls: NDArray[np.float64], width: int, height: int) -> NDArray[np.intp]:
    """Cells of the picture that hulls may touch.

    Parameters
    ----------
    hulls : ndarray, (N, K, 4) float64
        Clip space.
    width, height : int
        Of the viewport in pixels.

    Returns
    -------
    ndarray, (M, 2) intp
        Column and row, from the lower left corner, of cells of `CELL` pixels a side.
    """
    w = hulls[..., 3:]
    # Beyond what numbers hold there is no telling where a shadow goes.
    whole = (w <= 1e-9).any(axis=(1, 2)) | ~np.isfinite(hulls).all(axis=(1, 2))
    pixels = (hulls[..., :2] / np.where(w > 1e-9, w, 1.0) + 1) / 2 * (width, height)
    # Pixels that smoothed edges reach farther.
    low, high = pixels.min(axis=1) - EDGE, pixels.max(axis=1) + EDGE
    low[whole], high[whole] = 0, (width, height)
    last = np.array([-(-width // CELL), -(-height // CELL)])
    first = np.clip(np.floor(low / CELL), 0, last).astype(np.intp)
    end = np.clip(np.floor(high / CELL) + 1, 0, last).astype(np.intp)
    # Each rectangle adds one inside of it; running sums of +1 and -1 at its corners.
    steps = np.zeros(last + 1, np.intp)
    for x, y, sign in ((first, first, 1), (end, end, 1), (first, end, -1), (end, first, -1)):
        np.add.at(steps, (x[:, 0], y[:, 1]), sign)
    return np.argwhere(steps.cumsum(axis=0).cumsum(axis=1)[:-1, :-1] > 0)
