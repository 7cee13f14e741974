"""Where the tests find real models that are not part of the project."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SAMPLES = ROOT / "sample_models"
DATA = Path(os.environ.get("IMPOSTOR_DATA") or ROOT.parent / "shared" / "data")

needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="no real models: set IMPOSTOR_DATA to their folder")
