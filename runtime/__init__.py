"""Online: fans to pixels, in the caller's own moderngl context."""

from runtime.instances import Instances
from runtime.renderer import ImpostorRenderer

__all__ = ["ImpostorRenderer", "Instances"]
