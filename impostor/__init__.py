"""What an impostor is: the fan, its files and the arithmetic that bake and runtime share."""

from impostor.errors import ImpostorError
from impostor.fan import Fan
from impostor.files.fan_file import read_fan as load
from impostor.files.fan_file import write_fan as save
from impostor.lighting import DirectionalLight, Gloss
from impostor.model import Model, load_model
from impostor.shadow_projection import Ground

__all__ = ["DirectionalLight", "Fan", "Gloss", "Ground", "ImpostorError", "Model", "load", "load_model", "save"]
