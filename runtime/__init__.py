"""Online: fans to pixels, in the caller's own moderngl context."""

from runtime.cameras import Camera
from runtime.gpu import make_context
from runtime.grounds import GroundSurface
from runtime.instances import Instances
from runtime.renderer import ImpostorRenderer

__all__ = ["Camera", "GroundSurface", "ImpostorRenderer", "Instances", "make_context"]
