"""Bakes one model into one file with the defaults: the job whose time and memory are measured."""

from __future__ import annotations

import sys

from bake.fan import bake_fan
from impostor.files.fan_file import write_fan
from impostor.model import load_model

if __name__ == "__main__":
    write_fan(sys.argv[2], bake_fan(load_model(sys.argv[1])), force=True)
