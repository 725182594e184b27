"""A goniophotometer that needs no laboratory: a product's BSDF by tracing light through its section.

For every bin of the basis and from both sides, light of several directions within the bin is sent through, and what
leaves is sorted into bins. The spread over these directions says how well each value is known.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from transom.bsdf.bsdf import Bsdf, KlemsMatrix, Path, Spectrum
from transom.bsdf.directions import KLEMS_FULL, AngleBasis
from transom.files import write_atomic
from transom.products.product import Product
from transom.products.unit_cell import UnitCell

Float64 = NDArray[np.float64]

CLEAR_RAYS = 32
CELL_RAYS = 128
DIFFUSE_RAYS = 2048
"""Rays of each direction. Exact beams between straight lines need none; a diffuse surface sends one ray a way, and each
row of a table is to be hit many times."""

SIDES = {
    1: (Path.transmission_front, Path.reflection_front),
    -1: (Path.transmission_back, Path.reflection_back),
}
"""By the sign of z of the incident light, the paths that it fills."""


@dataclass(frozen=True)
class Measurement:
    """A product's tables and how well they are known.

    value_error: by path, (B, B) [1/sr], the standard error of each value of the table.
    transmittance, reflectance, absorptance, standard_error (2, B): hemispherical, by side (outdoors, room) and incident
    bin; standard_error is of the transmittance. Errors are of the mean over the directions in a bin, taken as if these
    were independent: they are spread evenly, so that the true errors are smaller.
    worst_balance: of a bin, largest |1 - transmitted - reflected - absorbed|; worst_unfinished: most light given up.
    """

    product: Product
    bsdf: Bsdf
    value_error: dict[Path, Float64]
    transmittance: Float64
    reflectance: Float64
    absorptance: Float64
    standard_error: Float64
    worst_balance: float
    worst_unfinished: float
    rays: int
    directions: int
    seed: int


def measure(
    product: Product,
    rays: int | None = None,
    directions: int = 96,
    seed: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Measurement:
    """Measures a product on the Klems basis. rays: of one direction; directions: in each bin."""
    basis, tracer = KLEMS_FULL, product.tracer()
    if rays is None:
        rays = DIFFUSE_RAYS if tracer.is_diffuse else CELL_RAYS if isinstance(tracer, UnitCell) else CLEAR_RAYS
    mirrored = basis.bin_of(basis.centres * np.array([-1.0, 1.0, 1.0]))
    own = np.arange(basis.count) if isinstance(tracer, UnitCell) else np.flatnonzero(mirrored >= np.arange(basis.count))
    tables = {path: np.zeros((basis.count, basis.count)) for paths in SIDES.values() for path in paths}
    errors = {path: np.zeros((basis.count, basis.count)) for path in tables}
    shares = np.zeros((4, 2, basis.count, directions))  # transmitted, reflected, absorbed, unfinished
    for row, (sign, (sent, back)) in enumerate(SIDES.items()):
        for done, column in enumerate(own.tolist()):
            binned = {path: np.zeros((directions, basis.count)) for path in (sent, back)}
            for number, direction in enumerate(directions_in(basis, column, directions, seed)):
                light = tracer.trace(direction * np.array([1.0, 1.0, sign]), rays, seed + number)
                for path, exits in ((sent, light.transmitted), (back, light.reflected)):
                    bins = basis.bin_of(exits.directions)
                    binned[path][number] = np.bincount(bins, exits.flux, basis.count)
                shares[:, row, column, number] = (
                    light.transmitted.total,
                    light.reflected.total,
                    light.absorbed,
                    light.unfinished,
                )
            for path, values in binned.items():
                tables[path][:, column] = values.mean(axis=0)
                errors[path][:, column] = _error_of_mean(values, 0)
            if progress is not None:
                progress(row * len(own) + done + 1, 2 * len(own))
        if len(own) < basis.count:  # a section is the same seen in a mirror: so are its columns
            twins = mirrored[own]
            for path in (sent, back):
                for values in (tables[path], errors[path]):
                    values[np.ix_(mirrored, twins)] = values[:, own]
            shares[:, row, twins] = shares[:, row, own]
    solid = basis.projected_solid_angles[:, None]
    scattering = {(Spectrum.visible, path): KlemsMatrix(basis, table / solid) for path, table in tables.items()}
    low, high = tracer.depth
    bsdf = Bsdf(product.title, "", str(product.file), scattering, high - low, (product.record.uncertainty.strip(),))
    transmittance, reflectance, absorptance, unfinished = means = shares.mean(axis=3)
    return Measurement(
        product=product,
        bsdf=bsdf,
        value_error={path: error / solid for path, error in errors.items()},
        transmittance=transmittance,
        reflectance=reflectance,
        absorptance=absorptance,
        standard_error=_error_of_mean(shares[0], 2),
        worst_balance=float(np.abs(means.sum(axis=0) - unfinished - 1).max()),
        worst_unfinished=float(unfinished.max()),
        rays=rays,
        directions=directions,
        seed=seed,
    )


def write_uncertainty(file: FilePath, found: Measurement) -> None:
    """Writes beside a table how well its values are known, as NPZ; btdf_measurements/README.md lists the arrays."""
    arrays: dict[str, NDArray[Any]] = {
        **{path.replace(" ", "_").lower(): error for path, error in found.value_error.items()},
        "transmittance": found.transmittance,
        "reflectance": found.reflectance,
        "absorptance": found.absorptance,
        "transmittance_error": found.standard_error,
        "provenance": np.array(json.dumps(provenance(found.product, found.rays, found.seed))),
    }
    content = io.BytesIO()
    np.savez_compressed(content, allow_pickle=False, **arrays)
    write_atomic(file, content.getvalue())


def provenance(product: Product, rays: int, seed: int) -> dict[str, object]:
    """What a measured file says of where it is from."""
    return {
        "product": product.name,
        "title": product.title,
        "status": product.record.status,
        "provenance": product.record.provenance.strip(),
        "uncertainty": product.record.uncertainty.strip(),
        "conventions": product.record.conventions,
        "parameters": dict(product.record.parameters),
        "rays": rays,
        "seed": seed,
        "transom": metadata.version("transom"),
    }


def _error_of_mean(values: Float64, axis: int) -> Float64:
    count = values.shape[axis]
    if count < 2:
        return np.full(values.mean(axis=axis).shape, np.nan)
    return np.asarray(values.std(axis=axis, ddof=1) / np.sqrt(count))


def directions_in(basis: AngleBasis, index: int, count: int, seed: int) -> Float64:
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
