"""Impostors in a program with its own OpenGL context: `python examples/embed.py [FAN] [OUT.png]`."""

import sys

import moderngl
import numpy as np
from PIL import Image

import impostor
from impostor.views import basis_facing
from runtime import ImpostorRenderer
