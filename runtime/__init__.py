"""Online: fans to pixels, in the caller's own moderngl context."""

from typing import TYPE_CHECKING

from impostor.lazy import lazy_names

if TYPE_CHECKING:
    from runtime.animation import AnimatedFan, AnimatedInstances
    from runtime.fans.lod import LevelOfDetail
    from runtime.gl.context import make_context
    from runtime.gl.offscreen import Offscreen
    from runtime.ground.ground_pass import GroundSurface
    from runtime.instances.instances import Instances
    from runtime.lights.contact_settings import ContactShadows
    from runtime.meshes.bump import Bump
    from runtime.renderer import ImpostorRenderer
    from runtime.rooms.capture import capture_environment
    from runtime.surfaces.surface_pass import Surface, lying_on, rectangle
    from runtime.viewing.cameras import Camera

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
    "Offscreen",
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
        "AnimatedInstances": "animation",
        "Bump": "meshes.bump",
        "Camera": "viewing.cameras",
        "ContactShadows": "lights.contact_settings",
        "GroundSurface": "ground.ground_pass",
        "ImpostorRenderer": "renderer",
        "Instances": "instances.instances",
        "LevelOfDetail": "fans.lod",
        "Offscreen": "gl.offscreen",
        "Surface": "surfaces.surface_pass",
        "capture_environment": "rooms.capture",
        "lying_on": "surfaces.surface_pass",
        "make_context": "gl.context",
        "rectangle": "surfaces.surface_pass",
    },
)
