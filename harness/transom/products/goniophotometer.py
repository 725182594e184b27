"""A goniophotometer that needs no laboratory: a product's BSDF by tracing light through its section.

For every bin of the basis and from both sides, light of several directions within the bin is sent through, and what
leaves is sorted into bins. The spread over these directions says how well each value is known.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from transom.bsdf.bsdf import Bsdf, KlemsMatrix, Path, Spectrum
from transom.bsdf.directions import KLEMS_FULL, AngleBasis
from transom.products.product import Product

Float64 = NDArray[np.float64]

SIDES = {
    1: (Path.transmission_front, Path.reflection_front),
    -1: (Path.transmission_back, Path.reflection_back),
}
"""By the sign of z of the incident light, the paths that it fills."""


@dataclass(frozen=True)
class Measurement:
    """A product's tables. transmittance, standard_error (2, B): hemispherical, by side (outdoors, room) and incident
    bin; the error is of the mean over the directions in a bin. worst_balance: largest |1 - T - R - absorbed|."""

    product: Product
    bsdf: Bsdf
    transmittance: Float64
    standard_error: Float64
    worst_balance: float
    rays: int


def measure(
    product: Product,
    rays: int = 256,
    directions: int = 8,
    seed: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Measurement:
    """Measures a product on the Klems basis. rays: over a period, for each of `directions` in each incident bin."""
    basis, section = KLEMS_FULL, product.section()
    tables = {path: np.zeros((basis.count, basis.count)) for paths in SIDES.values() for path in paths}
    transmittance = np.zeros((2, basis.count, directions))
    worst = 0.0
    total = 2 * basis.count
    for row, (sign, (sent, back)) in enumerate(SIDES.items()):
        for column in range(basis.count):
            for number, direction in enumerate(_directions_in(basis, column, directions, seed)):
                light = section.trace(direction * np.array([1.0, 1.0, sign]), rays, seed + number)
                for path, exits in ((sent, light.transmitted), (back, light.reflected)):
                    bins = basis.bin_of(exits.directions)
                    tables[path][:, column] += np.bincount(bins, exits.flux, basis.count) / directions
                transmittance[row, column, number] = light.transmitted.total
                balance = light.transmitted.total + light.reflected.total + light.absorbed + light.unfinished
                worst = max(worst, abs(balance - 1))
            if progress is not None:
                progress(row * basis.count + column + 1, total)
    scattering = {
        (Spectrum.visible, path): KlemsMatrix(basis, table / basis.projected_solid_angles[:, None])
        for path, table in tables.items()
    }
    low, high = section.depth
    bsdf = Bsdf(product.title, "", str(product.file), scattering, high - low, (product.record.uncertainty,))
    mean = transmittance.mean(axis=2)
    error = transmittance.std(axis=2, ddof=1) / np.sqrt(directions)
    return Measurement(product, bsdf, mean, error, worst, rays)


def _directions_in(basis: AngleBasis, index: int, count: int, seed: int) -> Float64:
    """Directions (count, 3) spread over a bin in proportion to projected solid angle, z > 0 [R2 sequence, jittered]."""
    first, ring = 0, 0
    while index >= first + basis.counts[ring]:
        first += basis.counts[ring]
        ring += 1
    jitter = np.random.default_rng([seed, index]).random(2)
    u = (jitter[0] + 0.7548776662466927 * np.arange(count)) % 1
    v = (jitter[1] + 0.5698402909980532 * np.arange(count)) % 1
    low, high = np.sin(np.radians(basis.edges_deg[ring])) ** 2, np.sin(np.radians(basis.edges_deg[ring + 1])) ** 2
    sine = np.sqrt(low + (high - low) * u)
    phi = 2 * np.pi * (index - first + v - 0.5) / basis.counts[ring]
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), np.sqrt(1 - sine**2)], axis=1)
