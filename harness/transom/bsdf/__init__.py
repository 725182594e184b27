"""Scattering of glazing products as tables: their directions, reading and writing files, what is wrong with them."""

from transom.bsdf.bsdf import Bsdf, Path, Spectrum
from transom.bsdf.read import read_bsdf

__all__ = ["Bsdf", "Path", "Spectrum", "read_bsdf"]
