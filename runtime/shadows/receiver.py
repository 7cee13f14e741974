"""What shadows fall on: the ground, without end, or a flat surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impostor.shadow_projection import Ground
from runtime.meshes.copies import MeshCopies, MeshInstance
from runtime.shadows.bounds import in_view, window_around
from runtime.shadows.meshes import mesh_corners
from runtime.surfaces.surface_pass import Surface
from runtime.viewing.viewer import Viewer

UPRIGHT = 0.5  # cosine of a slope from which on nothing stands on a surface


@dataclass(frozen=True, eq=False)
class Receiver:
    """A plane, and what of it there is.

    Parameters
    ----------
    ground : Ground
    mesh : MeshCopies, optional
        The one flat mesh that lies in the plane; left out, all of the plane is there.
    key : int, optional
        Of the surface.
    """

    ground: Ground
    mesh: MeshCopies | None = None
    key: int | None = None

    @classmethod
    def of(cls, surface: Surface, mesh: MeshInstance) -> Receiver:
        """A surface, and the mesh that casts in its place.

        Raises
        ------
        SettingsError
            A surface that is not flat.
        """
        (copies,) = MeshCopies.gathered([mesh])
        return cls(surface.plane(), copies, id(surface))

    def seen_by(self, viewer: Viewer) -> bool:
        """Whether a viewer may see something of the lit side."""
        if not self.ground.plane @ viewer.eye > 0:
            return False
        return self.mesh is None or bool(in_view(self._corners(viewer)[None])[0])

    @property
    def stood_on(self) -> bool:
        """Whether things have their feet on it."""
        return self.mesh is None or bool(self.ground.normal[1] > UPRIGHT)

    def window(self, viewer: Viewer) -> NDArray[np.float64]:
        """(4, 4): from clip space to that of the part of the picture which the receiver can be in."""
        if self.mesh is None:
            return np.eye(4)
        return window_around(self._corners(viewer))

    def middle(self, viewer: Viewer) -> NDArray[np.float64]:
        """A point (3,) for all of it: of a ground below the eye; below the picture's middle, if the eye is far off."""
        if self.mesh is not None:
            return mesh_corners(self.mesh)[0].mean(axis=0)
        eye = viewer.eye
        if eye[3] == 0:
            eye = np.linalg.solve(viewer.clip_from_world, [0.0, 0.0, 0.0, 1.0])
            eye = eye / eye[3]
        return eye[:3] - self.ground.plane @ eye * self.ground.normal

    def _corners(self, viewer: Viewer) -> NDArray[np.float64]:
        """Of the mesh's bounding box, clip space, (8, 4)."""
        assert self.mesh is not None
        return mesh_corners(self.mesh)[0] @ viewer.clip_from_world[:, :3].T + viewer.clip_from_world[:, 3]
