"""What an impostor is: the fan, its files and the arithmetic that bake and runtime share."""

from typing import TYPE_CHECKING

from impostor.lazy import lazy_names

if TYPE_CHECKING:
    from impostor.errors import ImpostorError
    from impostor.fan import Fan
    from impostor.files.fan_file import read_fan as load
    from impostor.files.fan_file import write_fan as save
    from impostor.lighting import DirectionalLight, Gloss
    from impostor.model import Model, load_model
    from impostor.shadow_projection import Ground

__all__ = ["DirectionalLight", "Fan", "Gloss", "Ground", "ImpostorError", "Model", "load", "load_model", "save"]

__getattr__ = lazy_names(
    __name__,
    {
        "DirectionalLight": "lighting",
        "Fan": "fan",
        "Gloss": "lighting",
        "Ground": "shadow_projection",
        "ImpostorError": "errors",
        "Model": "model",
        "load": "files.fan_file:read_fan",
        "load_model": "model",
        "save": "files.fan_file:write_fan",
    },
)
