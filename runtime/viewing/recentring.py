"""Pictures of what its file has put far from the origin: drawn around the origin, where 32 bits hold its shape."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from impostor.environment import Room
from impostor.fan import Fan
from impostor.model import Model
from runtime.viewing.cameras import Camera

FAR = 64.0
"""Bounding radii from the origin up to which nothing is moved: 32 bits round by a hundred-thousandth of one there."""
Subject = TypeVar("Subject", bound="Fan | Model")


def recentred(subject: Subject) -> tuple[Subject, NDArray[np.float64]]:
    """A fan or a model with its middle at the origin, and where that was, (3,); itself and zeros where it is near."""
    middle = subject.bounds.mean(axis=0)
    if not np.abs(middle).max() > FAR * subject.radius:
        return subject, np.zeros(3)
    if isinstance(subject, Fan):
        views = replace(subject.views, center=subject.views.center - middle)
        return replace(subject, views=views, bounds=subject.bounds - middle), middle
    parts = (replace(part, positions=(part.positions - middle).astype(np.float32)) for part in subject.primitives)
    return replace(subject, primitives=tuple(parts)), middle


def moved_camera(camera: Camera, middle: NDArray[np.float64]) -> Camera:
    """A camera that sees the origin as it saw `middle`."""
    return Camera(camera.clip_from_view, camera.view_from_world @ _translation(middle))


def moved_room(room: Room, middle: NDArray[np.float64]) -> Room:
    """A room that is around the origin as it was around `middle`."""
    if not middle.any():
        return room
    return replace(room, world_from_room=_translation(-middle) @ np.asarray(room.world_from_room))


def _translation(offset: NDArray[np.float64]) -> NDArray[np.float64]:
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return matrix
