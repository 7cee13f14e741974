"""Viewers' cameras: the two matrices that every pass takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.errors import SettingsError
from impostor.views import basis_facing, direction
from runtime.checks import check_number, numbers

FRAME_MARGIN = 1.02  # the picture is this much larger than the bounding sphere


@dataclass(frozen=True, eq=False)
class Camera:
    """Where a viewer stands and how the world falls on the picture.

    Parameters
    ----------
    clip_from_view, view_from_world : ndarray, (4, 4) float64
        Column-vector matrices in reading order; OpenGL clip space.
    """

    clip_from_view: NDArray[np.float64]
    view_from_world: NDArray[np.float64]

    @property
    def matrices(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Both, in the order in which the renderer's calls take them."""
        return self.clip_from_view, self.view_from_world

    def toward_eye(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Unit vector (3,) from a point toward the eye, world space."""
        rotation, offset = self.view_from_world[:3, :3], self.view_from_world[:3, 3]
        orthographic = self.clip_from_view[3, 3] == 1
        toward = rotation[2] if orthographic else -rotation.T @ offset - point
        return toward / np.linalg.norm(toward)

    @classmethod
    def perspective(
        cls,
        eye: ArrayLike,
        target: ArrayLike,
        fov_deg: float,
        aspect: float,
        near: float,
        far: float,
    ) -> Camera:
        """A camera at `eye` that looks at `target`.

        Parameters
        ----------
        eye, target : array_like, (3,) float
            World space.
        fov_deg : float
            Vertical field of view in degrees.
        aspect : float
            Width over height.
        near, far : float
            Metres.

        Raises
        ------
        SettingsError
            Eye and target coincide; a field of view, an aspect or a range that is impossible; what is no number.
        """
        eye, target = numbers("camera", "eye", eye, (3,)), numbers("camera", "target", target, (3,))
        for name, value in (("fov_deg", fov_deg), ("near", near), ("far", far)):
            check_number("camera", name, value)
        check_number("camera", "aspect", aspect, 0, above=True)
        if not np.linalg.norm(eye - target) > 0:
            raise SettingsError("camera", f"eye and target are both {eye.tolist()}; expected two different points")
        if not 0 < fov_deg < 180:
            raise SettingsError("fov_deg", f"{fov_deg:g} degrees; expected more than 0 and less than 180")
        if not 0 < near < far:
            raise SettingsError("camera", f"near {near:g} m, far {far:g} m; expected 0 < near < far")
        focal = 1 / np.tan(np.radians(fov_deg) / 2)
        clip = np.zeros((4, 4))
        clip[0, 0], clip[1, 1] = focal / aspect, focal
        clip[2, 2:] = -(far + near) / (far - near), -2 * far * near / (far - near)
        clip[3, 2] = -1
        return cls(clip, _view_from_world(basis_facing(eye - target), eye))

    @classmethod
    def orthographic(
        cls, center: ArrayLike, radius: float, azimuth: float, elevation: float, aspect: float = 1.0
    ) -> Camera:
        """A camera without perspective that frames a bounding sphere with a margin of 2 percent.

        Parameters
        ----------
        center : array_like, (3,) float
        radius : float
            Metres.
        azimuth, elevation : float
            Radians; where the camera stands.
        aspect : float
            Width over height; the sphere fits the shorter side.

        Raises
        ------
        SettingsError
            A radius or an aspect that is not above 0; what is no number.
        """
        center = numbers("camera", "center", center, (3,))
        for name, value in (("azimuth", azimuth), ("elevation", elevation)):
            check_number("camera", name, value)
        for name, value in (("radius", radius), ("aspect", aspect)):
            check_number("camera", name, value, 0, above=True)
        half = radius * FRAME_MARGIN
        # Ground beyond the sphere is seen too: leave it room along the line of sight.
        depth = 20 * radius
        clip = np.diag([1 / (half * max(aspect, 1)), min(aspect, 1) / half, -1 / depth, 1.0])
        return cls(clip, _view_from_world(basis_facing(direction(azimuth, elevation)), center))


def _view_from_world(basis: NDArray[np.float64], origin: NDArray[np.float64]) -> NDArray[np.float64]:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = basis, -basis @ origin
    return matrix
