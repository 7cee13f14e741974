"""Who casts shadows: copies of fans and of meshes, and where their bounding boxes are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from impostor.lighting import DirectionalLight
from runtime.fans.batch import Batch
from runtime.meshes.copies import MeshCopies, MeshInstance
from runtime.shadows.bounds import in_view, shadow_hulls
from runtime.shadows.meshes import mesh_corners
from runtime.shadows.receiver import Receiver
from runtime.shadows.strips import CastingFan
from runtime.viewing.viewer import Viewer

FLUSH = 1e-6  # of a box's size: what reaches no farther out of a plane lies in it


@dataclass(frozen=True, eq=False)
class Casters:
    """Copies of a fan or of a mesh.

    Parameters
    ----------
    copies : CastingFan or MeshCopies
    corners : ndarray, (N, 8, 3) float64
        Of their bounding boxes, world space; those of a flat mesh lie in its plane.
    world_from_shadow : tuple of ndarray, (N or 1, 4, 4) float64
        From the true shadow: to where it may be seen.
    clip_from_world : ndarray, (4, 4) float64
    receiver : Receiver
    stand : bool
        Whether they darken what is around their feet.
    """

    copies: CastingFan | MeshCopies
    corners: NDArray[np.float64]
    world_from_shadow: tuple[NDArray[np.float64], ...]
    clip_from_world: NDArray[np.float64]
    receiver: Receiver
    stand: bool = True

    @property
    def triangles(self) -> int:
        """Of one copy; 0 where they do not count."""
        return self.copies.buffers.triangle_count if isinstance(self.copies, MeshCopies) else 0

    def shadows(self, lights: Sequence[DirectionalLight]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Which copies (M,) cast what may be seen, and hulls (M, K, 4) of their shadows from all lights, clip space."""
        ground, front = self.receiver.ground, np.flatnonzero(self.in_front)
        corners = self.corners[front]
        places = [each if len(each) == 1 else each[front] for each in self.world_from_shadow]
        hull = np.concatenate([shadow_hulls(corners, each, light, ground) for light in lights for each in places], 1)
        seen = hull @ self.clip_from_world.T
        chosen = in_view(seen)
        if self.receiver.mesh is not None:
            chosen &= in_view(hull @ self.receiver.box_from_world.T)
        return front[chosen], seen[chosen]

    @cached_property
    def in_front(self) -> NDArray[np.bool_]:
        """Which copies (N,) reach out of the receiver's plane to its lit side: others cast nothing on it.

        A surface that lies in the plane, such as the receiver itself, does not.
        """
        heights = self.corners @ self.receiver.ground.normal - self.receiver.ground.offset
        size = np.abs(self.corners - self.corners[:, :1]).max(axis=(1, 2))
        return heights.max(axis=1) > (-FLUSH if self.stand else FLUSH) * size


class Casting(NamedTuple):
    """Everything that casts shadows; surfaces cast as meshes do, and have no feet."""

    fans: Sequence[Batch]
    meshes: Sequence[MeshInstance]
    surfaces: Sequence[MeshInstance]

    def __bool__(self) -> bool:
        return any(map(len, self))

    @property
    def key(self) -> tuple[object, ...]:
        """Equal while all of it stands as it stood."""
        return (
            *((*fan.instances.key, fan.levels and fan.levels.key) for fan in self.fans),
            *(
                (id(mesh.buffers), np.asarray(mesh.world_from_model, float).tobytes())
                for mesh in (*self.meshes, *self.surfaces)
            ),
        )


def casters_for(receiver: Receiver, viewer: Viewer, casting: Casting) -> list[Casters]:
    """All that can cast on a receiver, as a viewer sees it."""
    clip, ground, itself = viewer.clip_from_world, receiver.ground, np.eye(4)[None]
    found = []
    for fan in casting.fans:
        share = fan.levels and fan.levels.fan_share
        cast = CastingFan.of(fan.instances, viewer, ground, share, receiver.stood_on)
        # The shadow of a fan lies between where it meets the picture's feet and where the light casts it.
        between = cast.records["rows"].astype(float), itself
        found.append(Casters(cast, cast.corners(), between, clip, receiver))
    for stand, given in ((True, casting.meshes), (False, casting.surfaces)):
        found += [
            Casters(copies, mesh_corners(copies), (itself,), clip, receiver, stand)
            for copies in MeshCopies.gathered(given)
        ]
    return found
