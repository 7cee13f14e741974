"""Who shows which pixels of a crossfade: parts of one dither, each from one rank to another, that never overlap."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

WHOLE = (0.0, 1.0)


def part_of(shares: NDArray[np.float32]) -> NDArray[np.float32]:
    """The part (N, 2), from and to, that shares (N,) keep; one below 0 takes its pixels from the other end."""
    parts = np.empty((len(shares), 2), np.float32)
    parts[:, 0], parts[:, 1] = (1 + shares) * (shares < 0), np.where(shares < 0, 1, shares)
    return parts


def rest_of(shares: NDArray[np.float32], taken: NDArray[np.float32]) -> NDArray[np.float32]:
    """The part (N, 2) of some shares that is left beside those that were taken of them, of the same sign."""
    parts, other_end = part_of(shares), shares < 0
    parts[:, 0] = np.where(other_end, parts[:, 0], taken)
    parts[:, 1] = np.where(other_end, 1 + taken, parts[:, 1])
    return parts


def divided(parts: NDArray[np.float32], share: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Parts (N, 2) in two: the first holds a share (N,) of each, 0 to 1, the second the rest."""
    first, second = parts.copy(), parts.copy()
    between = parts[:, 0] + share * (parts[:, 1] - parts[:, 0])
    first[:, 1] = second[:, 0] = np.clip(between, parts[:, 0], parts[:, 1])
    return first, second
