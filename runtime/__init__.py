"""Online: fans to pixels, in the caller's own moderngl context."""

from typing import TYPE_CHECKING

from impostor.lazy import lazy_names

if TYPE_CHECKING:
    from runtime.animation import AnimatedFan, AnimatedInstances
    from runtime.bump import Bump
    from runtime.cameras import Camera
    from runtime.contact_shadows import ContactShadows
    from runtime.gpu import make_context
    from runtime.grounds import GroundSurface
    from runtime.instances import Instances
    from runtime.lod import LevelOfDetail
    from runtime.renderer import ImpostorRenderer
    from runtime.room_capture import capture_environment
    from runtime.surfaces import Surface, lying_on, rectangle

__all__ = [
    "AnimatedFan",
    "AnimatedInstances",
    "Bump",
    "Camera",
    "ContactShadows",
    "GroundSurface",
    "ImpostorRenderer",
    "Instances",
    "LevelOfDetail",
    "Surface",
    "capture_environment",
    "lying_on",
    "make_context",
    "rectangle",
]

__getattr__ = lazy_names(
    __name__,
    {
        "AnimatedFan": "animation",
        "Bump": "bump",
        "AnimatedInstances": "animation",
        "ContactShadows": "contact_shadows",
        "Camera": "cameras",
        "GroundSurface": "grounds",
        "ImpostorRenderer": "renderer",
        "Instances": "instances",
        "LevelOfDetail": "lod",
        "capture_environment": "room_capture",
        "Surface": "surfaces",
        "lying_on": "surfaces",
        "make_context": "gpu",
        "rectangle": "surfaces",
    },
)
