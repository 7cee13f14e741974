"""Crossfades between a fan's views: a copy does not jump from one picture to the next."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

VIEW_FADE_SECONDS = 0.2
SHORTEST = 1e-9  # seconds of a fade, where no time has passed at all


class ViewFades:
    """Which view each copy of a fan shows, and which one it is leaving, kept from frame to frame.

    A copy takes no longer to its next view than it stayed with the last: for a viewer who moves fast, fades are
    short, and no picture lags by more than one view. A copy that comes into the picture shows the nearest view at once.

    Parameters
    ----------
    count : int
        Of copies.

    Attributes
    ----------
    shown, leaving : ndarray, (N,) intp
        The view that each copy shows or fades to, and the one it fades from.
    share : ndarray, (N,) float32
        The part of each copy's pixels that shows the former; 1 where there is no fade.
    fading : bool
        Whether any copy that was seen last is in a fade.
    """

    def __init__(self, count: int):
        self.shown, self.leaving = np.zeros(count, np.intp), np.zeros(count, np.intp)
        self.share, self.fading = np.ones(count, np.float32), False
        self._span, self._stayed = np.ones(count, np.float32), np.zeros(count, np.float32)
        self._seen, self._frame, self._rested = np.full(count, -1), 0, 0.0

    def rest(self, seconds: float) -> None:
        """Let time pass in which nothing moves and nothing fades."""
        self._rested += seconds

    def update(self, copies: NDArray[np.intp], nearest: NDArray[np.intp], seconds: float, fade_seconds: float) -> None:
        """Let time pass for the copies that are seen in a frame.

        Parameters
        ----------
        copies : ndarray, (M,) intp
        nearest : ndarray, (M,) intp
            The view that is nearest to the viewer, of each.
        seconds : float
            Since the last frame. As many as a fade takes, or more, end all of them.
        fade_seconds : float
            The longest that a fade takes.
        """
        self._frame += 1
        known = self._seen.take(copies) == self._frame - 1
        self._seen[copies] = self._frame
        rested, self._rested = self._rested, 0.0
        if seconds >= fade_seconds:
            self.shown[copies], self.share[copies], self._stayed[copies] = nearest, 1, fade_seconds
            self.fading = False
            return
        before = self.share.take(copies)
        share = np.minimum(before + seconds / self._span.take(copies), 1)
        stayed = self._stayed.take(copies) + np.float32(seconds + rested)
        new = np.flatnonzero(~known)
        before[new], share[new], stayed[new] = 1, 1, fade_seconds
        self.shown[copies[new]] = nearest[new]
        switched = np.flatnonzero(self.shown.take(copies) != nearest)
        if len(switched):
            which, to = copies[switched], nearest[switched]
            # Who turns round takes back what has been shown of the fade.
            back = (before[switched] < 1) & (self.leaving[which] == to)
            span = np.where(back, self._span[which], np.clip(stayed[switched], seconds, fade_seconds))
            span = np.maximum(span, SHORTEST)
            share[switched] = np.minimum(np.where(back, 1 - before[switched], 0) + seconds / span, 1)
            self.leaving[which], self.shown[which] = self.shown[which], to
            self._span[which], stayed[switched] = span, 0
        self.share[copies], self._stayed[copies] = share, stayed
        self.fading = bool((share < 1).any())

    def shares(self, copies: NDArray[np.intp], nearest: NDArray[np.intp]) -> NDArray[np.float32]:
        """The part (M,) of each copy's pixels that shows its nearest view; 1 for a look that is not in the fade.

        A viewer elsewhere than the last frame's, in a mirror or another window, may have another view nearest to him.
        """
        if not self.fading:
            return np.ones(len(copies), np.float32)
        in_fade = (self._seen.take(copies) == self._frame) & (self.shown.take(copies) == nearest)
        return np.where(in_fade, self.share.take(copies), np.float32(1))
