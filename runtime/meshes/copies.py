"""Where meshes stand: one by one, and copies of one mesh that are drawn together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from impostor.environment.reflection import Reflection
from impostor.lighting import Gloss
from runtime.checks import LARGEST, bounded, check_type
from runtime.instances.dither import WHOLE
from runtime.meshes.buffers import COPY_DTYPE, MeshBuffers
from runtime.viewing.viewer import Viewer


@dataclass
class MeshInstance:
    """One mesh in the world.

    Parameters
    ----------
    buffers : MeshBuffers
    world_from_model : ndarray, (4, 4) float
        Rotation, translation and uniform scale.
    gloss : Gloss
    reflection : Reflection, optional
        What it mirrors where there are rooms.
    visible : bool
        Whether it is drawn, and casts a shadow.
    """

    buffers: MeshBuffers
    world_from_model: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    gloss: Gloss = field(default_factory=Gloss)
    reflection: Reflection | None = None
    visible: bool = True


def check_meshes(meshes: Sequence[MeshInstance]) -> None:
    """Refuse a `world_from_model` that has become none that can be drawn, and a `reflection` that is none.

    Raises
    ------
    SettingsError
    """
    try:
        matrices = np.array([mesh.world_from_model for mesh in meshes], float)
    except (TypeError, ValueError):
        matrices = np.empty(0)
    if len(meshes) and (matrices.shape != (len(meshes), 4, 4) or not (np.abs(matrices) < LARGEST).all()):
        for mesh in meshes:
            bounded(mesh.buffers.model.name, "world_from_model", mesh.world_from_model, (4, 4))
    for mesh in meshes:
        if mesh.reflection is not None:
            check_type("reflection", mesh.reflection, Reflection)


@dataclass(frozen=True, eq=False)
class MeshCopies:
    """Copies of one mesh that are drawn together.

    Parameters
    ----------
    buffers : MeshBuffers
    gloss : Gloss
    world_from_model : ndarray, (N, 4, 4) float64
        Affine.
    parts : ndarray, (N, 2) float32, optional
        Of the dither, from and to: which pixels of each copy are drawn, in a crossfade.
    reflection : Reflection, optional
    """

    buffers: MeshBuffers
    gloss: Gloss
    world_from_model: NDArray[np.float64]
    parts: NDArray[np.float32] | None = None
    reflection: Reflection | None = None

    @classmethod
    def gathered(cls, meshes: Sequence[MeshInstance]) -> list[MeshCopies]:
        """Meshes that share buffers, gloss and reflection, put together."""
        groups: dict[tuple[int, Gloss, Reflection | None], list[MeshInstance]] = {}
        for mesh in meshes:
            groups.setdefault((id(mesh.buffers), mesh.gloss, mesh.reflection), []).append(mesh)
        return [
            cls(
                group[0].buffers,
                group[0].gloss,
                np.array([mesh.world_from_model for mesh in group], float),
                reflection=group[0].reflection,
            )
            for group in groups.values()
        ]

    def seen_by(self, viewer: Viewer) -> MeshCopies:
        """Those whose bounding sphere touches the view frustum, near to far."""
        centers, radii = self.spheres
        seen = np.flatnonzero(viewer.sees(centers, radii))
        return self.take(seen[np.argsort(-(centers[seen] @ viewer.view_from_world[2, :3]), kind="stable")])

    @property
    def spheres(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Middles (N, 3) and radii (N,) of the copies' bounding spheres, world space."""
        model, turned = self.buffers.model, self.world_from_model[:, :3, :3]
        centers = turned @ model.bounds.mean(axis=0) + self.world_from_model[:, :3, 3]
        # The largest row of its product with itself bounds how a matrix stretches, exactly where axes stay at right
        # angles.
        stretch = np.abs(turned.swapaxes(1, 2) @ turned).sum(axis=2).max(axis=1)
        return centers, model.radius * np.sqrt(stretch)

    def take(self, index: NDArray[np.intp]) -> MeshCopies:
        """Some of them."""
        parts = None if self.parts is None else self.parts[index]
        return MeshCopies(self.buffers, self.gloss, self.world_from_model[index], parts, self.reflection)

    def records(self) -> NDArray[np.void]:
        """As (N,) COPY_DTYPE: they place the buffers' positions."""
        placed = self.world_from_model[:, :3].copy()
        placed[:, :, 3] += placed[:, :, :3] @ self.buffers.origin
        rows = np.zeros((len(placed), COPY_DTYPE.itemsize // 4), np.float32)
        rows[:, :12] = placed.reshape(-1, 12)
        rows[:, 12:14] = WHOLE if self.parts is None else self.parts
        return rows.view(COPY_DTYPE)[:, 0]
