"""What shadows fall on: the ground, without end, or a flat surface."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from impostor.errors import SettingsError
from impostor.shadow_projection import Ground
from runtime.meshes.copies import MeshCopies, MeshInstance
from runtime.shadows.bounds import in_view
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
        normal, point, off, flat = mesh.buffers.plane
        if not flat:
            out = f"reaches {off:g} m out of a plane" if normal.any() else "faces every way as much as its opposite"
            raise SettingsError("surface", f"{surface.model.name} {out}; expected a flat model to cast on")
        (copies,) = MeshCopies.gathered([mesh])
        turn, place = copies.world_from_model[0, :3, :3], copies.world_from_model[0, :3, 3]
        # Uniform scale: normals turn as the model does, and a mirrored model shows its light on the other side.
        normal = turn @ normal * np.sign(np.linalg.det(turn))
        return cls(Ground(normal, float(normal @ (turn @ point + place))), copies, id(surface))

    def seen_by(self, viewer: Viewer) -> bool:
        """Whether a viewer may see something of the lit side."""
        if not self.ground.plane @ viewer.eye > 0:
            return False
        if self.mesh is None:
            return True
        clip = viewer.clip_from_world
        return bool(in_view(mesh_corners(self.mesh) @ clip[:, :3].T + clip[:, 3])[0])

    @property
    def stood_on(self) -> bool:
        """Whether things have their feet on it."""
        return self.mesh is None or bool(self.ground.normal[1] > UPRIGHT)

    @cached_property
    def box_from_world(self) -> NDArray[np.float64]:
        """(4, 4): to where the mesh lies between -1 and 1 along two axes of the plane."""
        assert self.mesh is not None
        matrix, model = self.mesh.world_from_model[0], self.mesh.buffers.model
        low, high = model.bounds
        half = np.where(high > low, (high - low) / 2, 1.0)
        box = np.diag([*(1 / half), 1.0]) @ np.linalg.inv(matrix)
        box[:3, 3] -= (low + high) / 2 / half
        # The axis along the normal does not count.
        box[np.abs(box[:3, :3] @ self.ground.normal * half).argmax()] = 0
        return box

    def middle(self, viewer: Viewer) -> NDArray[np.float64]:
        """A point (3,) for all of it: of a ground below the eye; below the picture's middle, if the eye is far off."""
        if self.mesh is not None:
            return mesh_corners(self.mesh)[0].mean(axis=0)
        eye = viewer.eye
        if eye[3] == 0:
            eye = np.linalg.solve(viewer.clip_from_world, [0.0, 0.0, 0.0, 1.0])
            eye = eye / eye[3]
        return eye[:3] - self.ground.plane @ eye * self.ground.normal
