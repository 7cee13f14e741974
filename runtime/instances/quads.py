"""Quads: which picture of a fan each copy shows to a viewer, and where that stands in the world."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from runtime.instances.instances import Instances
from runtime.instances.placement import Placement
from runtime.viewing.viewer import Viewer


@dataclass(frozen=True, eq=False)
class Quads:
    """What one viewer is shown of some instances: one fan view each, as a quad in the world.

    Parameters
    ----------
    placement : Placement
        Of all the instances.
    index : ndarray, (N,) intp
        Which of them.
    view : ndarray, (N,) intp
        Of the fan; mostly the nearest.

    Attributes
    ----------
    scale : ndarray, (N,) float64
    basis : ndarray, (N, 3, 3) float64
        The view's right, up and back as turned in the world; orthonormal.
    origin : ndarray, (N, 3) float64
        World position of the view's centre.
    center, right, up : ndarray, (N, 3) float64
        The quad: tile coordinates (x, y), in the view's metres, are drawn at `center + x right + y up`.
    """

    placement: Placement
    index: NDArray[np.intp]
    view: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.index)

    @cached_property
    def scale(self) -> NDArray[np.float64]:
        return self.placement.scales.take(self.index)

    @cached_property
    def basis(self) -> NDArray[np.float64]:
        return np.stack([self._turned(name).T for name in ("axis_right", "axis_up", "axis_back")], axis=1)

    @cached_property
    def back(self) -> NDArray[np.float64]:
        """The last of the basis (N, 3)."""
        return self._turned("axis_back").T

    @property
    def middle(self) -> NDArray[np.float64]:
        """World position (N, 3) of the middle of all the views' centres."""
        return self.placement.middles.take(self.index, axis=1).T

    @cached_property
    def origin(self) -> NDArray[np.float64]:
        return self._placed("origin").T

    @cached_property
    def center(self) -> NDArray[np.float64]:
        return self._placed("center").T

    @cached_property
    def right(self) -> NDArray[np.float64]:
        return (self.scale * self._turned("right")).T

    @cached_property
    def up(self) -> NDArray[np.float64]:
        return (self.scale * self._turned("up")).T

    @cached_property
    def _turns(self) -> NDArray[np.complex128]:
        return self.placement.turns.take(self.index)

    def _turned(self, name: str) -> NDArray[np.float64]:
        return self.placement.view_vectors.turned(name, self.view, self._turns)

    def _placed(self, name: str) -> NDArray[np.float64]:
        vectors = self._turned(name)
        vectors *= self.scale
        vectors += self.placement.positions.take(self.index, axis=1)
        return vectors

    def take(self, which: NDArray[Any]) -> Quads:
        """Some of them, by index or mask."""
        return type(self)(self.placement, self.index[which], self.view[which])


class UnturnedQuads(Quads):
    """Quads whose normals stay as the fan stores them, each in its own view."""

    @cached_property
    def basis(self) -> NDArray[np.float64]:
        return np.broadcast_to(np.eye(3), (len(self), 3, 3))


def nearest_views(instances: Instances, eye: NDArray[np.float64], index: NDArray[np.intp]) -> NDArray[np.intp]:
    """The fan view nearest to an eye, or to a light, of each instance.

    Parameters
    ----------
    instances : Instances
    eye : ndarray, (4,) float64
        Homogeneous, `Viewer.eye`; (x, y, z, 0) for a direction.
    index : ndarray, (N,) intp
        Which instances.

    Returns
    -------
    ndarray, (N,) intp
    """
    return _nearest(instances.placement, eye, index)


def _nearest(placement: Placement, eye: NDArray[np.float64], index: NDArray[np.intp]) -> NDArray[np.intp]:
    # Not of unit length: no layout asks for that.
    toward = eye[:3, None] - eye[3] * placement.middles.take(index, axis=1)
    level = toward[2] + 1j * toward[0]
    level *= placement.turns.take(index).conj()
    return placement.view_vectors.nearest(level.imag, toward[1], level.real)


def quads_toward(instances: Instances, eye: NDArray[np.float64], viewer: Viewer | None = None) -> Quads:
    """The nearest view of every visible instance, set up in the world (the paper's figure 2).

    The quad lies in the plane that follows the surface its view shows, turned with the instance: seen from the view's
    own camera that makes no difference, and from beside it what lies in the plane is drawn where the mesh would be.
    Copies with a number that is not finite, or a scale that is not positive, are left out.

    Parameters
    ----------
    instances : Instances
    eye : ndarray, (4,) float64
        Homogeneous, `Viewer.eye`.
    viewer : Viewer, optional
        Leave out what is certainly beside the picture.

    Returns
    -------
    Quads
    """
    placement = instances.placement
    shown = instances.visible & (placement.radii > 0)
    if viewer is not None:
        shown &= viewer.sees(placement.middles.T, placement.radii)
    index = np.flatnonzero(shown)
    return Quads(placement, index, _nearest(placement, eye, index))
