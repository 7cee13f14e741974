"""Online: fans to pixels, in the caller's own moderngl context."""

from typing import TYPE_CHECKING

from impostor.lazy import lazy_names

if TYPE_CHECKING:
    from runtime.animation import AnimatedFan, AnimatedInstances
    from runtime.cameras import Camera
    from runtime.gpu import make_context
    from runtime.grounds import GroundSurface
    from runtime.instances import Instances
    from runtime.lod import LevelOfDetail
    from runtime.renderer import ImpostorRenderer
    from runtime.surfaces import Surface, lying_on, rectangle

__all__ = [
    "AnimatedFan",
    "AnimatedInstances",
    "Camera",
    "GroundSurface",
    "ImpostorRenderer",
    "Instances",
    "LevelOfDetail",
    "Surface",
    "lying_on",
    "make_context",
    "rectangle",
]

__getattr__ = lazy_names(
    __name__,
    {
        "AnimatedFan": "animation",
        "AnimatedInstances": "animation",
        "Camera": "cameras",
        "GroundSurface": "grounds",
        "ImpostorRenderer": "renderer",
        "Instances": "instances",
        "LevelOfDetail": "lod",
        "Surface": "surfaces",
        "lying_on": "surfaces",
        "make_context": "gpu",
        "rectangle": "surfaces",
    },
)
