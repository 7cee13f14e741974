"""What an impostor is: the fan, its files and the arithmetic that bake and runtime share."""

from impostor.lazy import lazy_names

TYPE_CHECKING = False  # as type checkers know it; `typing` takes longer to import than Ctrl-C should have to wait
if TYPE_CHECKING:
    from impostor.environment import Environment, Reflection, Room
    from impostor.errors import ImpostorError
    from impostor.fan import Fan
    from impostor.files.environment_file import read_environment as load_environment
    from impostor.files.environment_file import write_environment as save_environment
    from impostor.files.fan_file import read_fan as load
    from impostor.files.fan_file import write_fan as save
    from impostor.files.ptm_file import read_ptm as load_ptm
    from impostor.files.ptm_file import write_ptm as save_ptm
    from impostor.lighting import DirectionalLight, Gloss, LocalLight
    from impostor.model import Model, load_model
    from impostor.ptm.quantise import Ptm
    from impostor.shadow_projection import Ground

__all__ = [
    "DirectionalLight",
    "Environment",
    "Fan",
    "Gloss",
    "Ground",
    "ImpostorError",
    "LocalLight",
    "Model",
    "Ptm",
    "Reflection",
    "Room",
    "load",
    "load_environment",
    "load_model",
    "load_ptm",
    "save",
    "save_environment",
    "save_ptm",
]

__getattr__ = lazy_names(
    __name__,
    {
        "Environment": "environment",
        "DirectionalLight": "lighting",
        "Fan": "fan",
        "Gloss": "lighting",
        "Ground": "shadow_projection",
        "ImpostorError": "errors",
        "LocalLight": "lighting",
        "Model": "model",
        "Reflection": "environment",
        "Room": "environment",
        "Ptm": "ptm.quantise",
        "load_environment": "files.environment_file:read_environment",
        "load": "files.fan_file:read_fan",
        "load_model": "model",
        "load_ptm": "files.ptm_file:read_ptm",
        "save_environment": "files.environment_file:write_environment",
        "save": "files.fan_file:write_fan",
        "save_ptm": "files.ptm_file:write_ptm",
    },
)
