"""Light from all around: cube maps, what they do to a surface, and rooms that are as large as they look."""

from impostor.environment.environment import Environment
from impostor.environment.reflection import Reflection
from impostor.environment.room import Room

__all__ = ["Environment", "Reflection", "Room"]
