"""Polynomial Texture Maps: every texel a polynomial of the light's direction (HPL-98-131, HPL-2004-225)."""

from impostor.ptm.polynomials import Polynomials, basis, evaluate, relight
from impostor.ptm.quantise import Ptm, quantise

__all__ = ["Polynomials", "Ptm", "basis", "evaluate", "quantise", "relight"]
