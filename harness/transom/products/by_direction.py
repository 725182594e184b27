"""Measurements by incident direction: where light of each leaves, exit by exit, without bins.

For what lies between measured directions a table of bins says too little: interpolation needs the exits themselves.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from transom.errors import InputError
from transom.files import write_atomic
from transom.products.goniophotometer import provenance
from transom.products.product import Product
from transom.products.section import Exits

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
ARRAYS = ("incident", "first", "directions", "flux", "reflected", "absorbed", "unfinished", "provenance")


@dataclass(frozen=True)
class DirectionalMeasurement:
    """Transmission by incident direction, from outdoors.

    incident (N, 3): directions of propagation, z > 0. first (N + 1,): exits first[k]..first[k + 1] are of incidence k.
    directions (M, 3), flux (M,): of the exits, flux as a share of the incident flux. reflected, absorbed, unfinished
    (N,): the other shares; all add up to 1. provenance: of the product, rays and seed.
    """

    incident: Float64
    first: Int64
    directions: Float64
    flux: Float64
    reflected: Float64
    absorbed: Float64
    unfinished: Float64
    provenance: dict[str, object]

    def exits(self, incidence: int) -> Exits:
        """Transmitted light of one incident direction."""
        part = slice(int(self.first[incidence]), int(self.first[incidence + 1]))
        return Exits(self.directions[part], self.flux[part])

    @property
    def transmittance(self) -> Float64:
        """Of each incident direction (N,)."""
        sums = np.concatenate([[0.0], np.cumsum(self.flux)])
        return np.asarray(np.diff(sums[self.first]))


def incident_grid(step_deg: float) -> Float64:
    """Directions (N, 3), z > 0, on rings of `step_deg` in polar angle, about as far apart along each ring; bin 0 of a
    ring at azimuth 0. 144 directions at 12 degrees, 544 at 6."""
    rows: list[Float64] = []
    for ring in range(int(np.ceil(90 / step_deg - 1e-9))):
        theta = np.radians(ring * step_deg)
        count = max(1, round(360 * np.sin(theta) / step_deg))
        phi = 2 * np.pi * np.arange(count) / count
        rows.append(
            np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.full(count, np.cos(theta))], 1)
        )
    return np.concatenate(rows)


def measure_by_direction(
    product: Product,
    step_deg: float,
    rays: int = 256,
    seed: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> DirectionalMeasurement:
    """Traces light of a regular grid of incident directions from outdoors."""
    tracer, incident = product.tracer(), incident_grid(step_deg)
    parts: list[Exits] = []
    rest = np.zeros((3, len(incident)))
    for k, direction in enumerate(incident):
        light = tracer.trace(direction, rays, seed + k)
        parts.append(light.transmitted)
        rest[:, k] = light.reflected.total, light.absorbed, light.unfinished
        if progress is not None:
            progress(k + 1, len(incident))
    first = np.concatenate([[0], np.cumsum([len(part.flux) for part in parts])]).astype(np.int64)
    return DirectionalMeasurement(
        incident,
        first,
        np.concatenate([part.directions for part in parts]),
        np.concatenate([part.flux for part in parts]),
        rest[0],
        rest[1],
        rest[2],
        {**provenance(product, rays, seed), "step_deg": step_deg},
    )


def write_by_direction(file: Path, found: DirectionalMeasurement) -> None:
    """Writes .npz (arrays as above, provenance as JSON) or .csv (one exit a row, provenance in lines of #)."""
    if file.suffix.lower() == ".csv":
        write_atomic(file, _csv(found))
        return
    content = io.BytesIO()
    arrays = {name: getattr(found, name) for name in ARRAYS[:-1]}
    np.savez_compressed(content, **arrays, provenance=np.array(json.dumps(found.provenance)))
    write_atomic(file, content.getvalue())


def read_by_direction(file: Path) -> DirectionalMeasurement:
    """Reads an .npz of `write_by_direction`. Raises InputError for a file that is none, or does not hold together."""
    try:
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as content:
            missing = [name for name in ARRAYS if name not in content.files]
            if missing:
                raise InputError(
                    "is missing", file=file, field=missing[0], remedy="transom measure --directions makes it"
                )
            arrays = {name: np.array(content[name]) for name in ARRAYS}
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise InputError(f"is no measurement by direction ({error})", file=file) from None
    found = DirectionalMeasurement(
        **{name: arrays[name] for name in ARRAYS[:-1]}, provenance=json.loads(str(arrays["provenance"]))
    )
    count, exits = len(found.incident), len(found.flux)
    if found.first.shape != (count + 1,) or found.first[-1] != exits or found.directions.shape != (exits, 3):
        raise InputError("do not belong together", file=file, field="incident, first, directions, flux")
    total = found.transmittance + found.reflected + found.absorbed + found.unfinished
    if not np.allclose(total, 1, atol=1e-4):
        worst = float(np.abs(total - 1).max())
        raise InputError("do not add up to 1", file=file, field="flux, reflected, absorbed, unfinished", value=worst)
    return found


def _csv(found: DirectionalMeasurement) -> str:
    def angles(directions: Float64) -> Float64:
        theta = np.degrees(np.arccos(np.clip(directions[:, 2], -1, 1)))
        return np.column_stack([theta, np.degrees(np.arctan2(directions[:, 1], directions[:, 0])) % 360])

    incidence = np.repeat(np.arange(len(found.incident)), np.diff(found.first))
    rows = np.column_stack([angles(found.incident)[incidence], angles(found.directions), found.flux])
    lines = [f"# {name}: {json.dumps(value)}" for name, value in found.provenance.items()]
    lines.append("incident_theta_deg,incident_phi_deg,exit_theta_deg,exit_phi_deg,flux")
    lines += [",".join(f"{value:.9g}" for value in row) for row in rows]
    return "\n".join(lines) + "\n"
