"""pab-opto text files of goniophotometer scans: a header of # lines, then "theta phi value" of one incidence.

theta is the angle to the normal that looks into the room, phi counter-clockwise seen from there, both of directions
that point away from the sample: towards the source for incident light. `#upphi` says which phi is up (pab-opto: 90 is
usual). A value is a BSDF [1/sr], or a DSF: BSDF times |cos(theta)|. [Radiance: src/cv/pabopto2bsdf.c reads the same]
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path as FilePath

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from transom.bsdf.bsdf import Bsdf, Path, Scattering, Spectrum
from transom.bsdf.directions import AngleBasis, disc_from_square
from transom.errors import InputError

Float64 = NDArray[np.float64]

VALUE_COLUMNS = {"CIE-Y": 1, "CIE-XYZ": 3}
LEAST_COSINE = 0.02
"""A DSF closer to grazing than this cannot be divided by its cosine, and is left out."""

SQUARE_SIDE = 96
"""Cells a side over which a scan is integrated."""


@dataclass(frozen=True)
class Scan:
    """One incidence: propagation of its light (3,), and BSDF values (N,) [1/sr] by leaving direction (N, 3)."""

    incident: Float64
    leaving: Float64
    values: Float64


@dataclass(frozen=True)
class MeasuredScans:
    """Scans of one path of light. Between measured directions the nearest one speaks."""

    scans: tuple[Scan, ...]

    @cached_property
    def _incidences(self) -> cKDTree:
        return cKDTree(np.stack([scan.incident[:2] for scan in self.scans]))

    @cached_property
    def _trees(self) -> tuple[cKDTree, ...]:
        return tuple(cKDTree(scan.leaving) for scan in self.scans)

    def evaluate(self, incident: Float64, leaving: Float64) -> Float64:
        incident, leaving = np.broadcast_arrays(np.asarray(incident, np.float64), np.asarray(leaving, np.float64))
        shape = incident.shape[:-1]
        incident, leaving = incident.reshape(-1, 3), leaving.reshape(-1, 3)
        which = self._incidences.query(incident[:, :2])[1]
        result = np.empty(len(incident))
        for number in np.unique(which):
            chosen = which == number
            side = np.sign(self.scans[number].leaving[0, 2])
            towards = np.column_stack([leaving[chosen, :2], side * np.abs(leaving[chosen, 2])])
            result[chosen] = self.scans[number].values[self._trees[number].query(towards)[1]]
        return result.reshape(shape)

    def hemispherical(self, incident: Float64) -> Float64:
        incident = np.asarray(incident, np.float64)
        directions, weight = _square_directions()
        which = self._incidences.query(incident.reshape(-1, 3)[:, :2])[1]
        sums = {
            int(n): weight * float(self.evaluate(self.scans[n].incident, directions).sum()) for n in np.unique(which)
        }
        return np.array([sums[int(n)] for n in which]).reshape(incident.shape[:-1])

    def klems(self, basis: AngleBasis) -> Float64:
        directions, _ = _square_directions()
        directions = np.concatenate([directions, basis.centres])
        bins = basis.bin_of(directions)
        counts = np.bincount(bins, minlength=basis.count)
        columns = [
            np.bincount(bins, self.evaluate(centre, directions), basis.count) / counts for centre in basis.centres
        ]
        return np.stack(columns, 1)


def read_pab_opto(files: Sequence[FilePath]) -> Bsdf:
    """A product from scans of one or more incidences. Raises InputError naming file, line and what is wrong."""
    scans: dict[Path, list[Scan]] = {}
    names: list[str] = []
    for file in files:
        name, parts = _read_scan(file)
        names.append(name)
        for path, scan in parts.items():
            scans.setdefault(path, []).append(scan)
    scattering: dict[tuple[Spectrum, Path], Scattering] = {
        (Spectrum.visible, path): MeasuredScans(tuple(found)) for path, found in scans.items()
    }
    notes = ["between measured directions the nearest measurement is used"]
    if len(set(names)) > 1:
        notes.append(f"the files name different samples: {', '.join(sorted(set(names)))}")
    return Bsdf(names[0] or files[0].stem, "", str(files[0]), scattering, notes=tuple(notes))


def _read_scan(file: FilePath) -> tuple[str, dict[Path, Scan]]:
    header, rows = _split(file)
    joined = "\n".join(header)
    kind = re.search(r"^format:\s*theta\s+phi\s+(\w+)", joined, re.MULTILINE | re.IGNORECASE)
    if kind is None or kind[1].upper() not in ("DSF", "BSDF", "BTDF", "BRDF"):
        remedy = 'The header says "#format: theta phi DSF" or BSDF, BTDF, BRDF'
        raise InputError("is not given", file=file, field="#format", value=kind[1] if kind else None, remedy=remedy)
    theta, phi = _incident_angles(joined, file)
    up = _number(joined, "upphi", file)
    if up is None:
        up = 0.0
    colour = re.search(r"^colorimetry:\s*(\S+)", joined, re.MULTILINE | re.IGNORECASE)
    if colour is not None and colour[1].upper() not in VALUE_COLUMNS:
        remedy = f"Use {' or '.join(VALUE_COLUMNS)}"
        raise InputError("is not supported", file=file, field="#colorimetry", value=colour[1], remedy=remedy)
    columns = 1 if colour is None else VALUE_COLUMNS[colour[1].upper()]
    if rows.shape[1] != 2 + columns:
        value = f"{rows.shape[1]} columns"
        remedy = f"theta, phi and {columns} value columns"
        raise InputError("is not what the header announces", file=file, field="data", value=value, remedy=remedy)
    away = _direction(rows[:, 0], rows[:, 1] + 90 - up)
    values = rows[:, 2 + (columns == 3)]  # Y of XYZ
    if (values < 0).any():
        raise InputError("holds negative values", file=file, field="data", value=float(values.min()))
    keep = np.abs(away[:, 2]) > LEAST_COSINE
    if kind[1].upper() == "DSF":
        values = values / np.maximum(np.abs(away[:, 2]), LEAST_COSINE)
    source = _direction(np.array([theta]), np.array([phi + 90 - up]))[0]
    parts: dict[Path, Scan] = {}
    for is_room_side in (True, False):
        chosen = keep & ((away[:, 2] > 0) == is_room_side)
        if not chosen.any():
            continue
        from_room = source[2] > 0
        if is_room_side:
            path = Path.reflection_back if from_room else Path.transmission_front
        else:
            path = Path.transmission_back if from_room else Path.reflection_front
        parts[path] = Scan(-source, away[chosen], values[chosen])
    name = re.search(r'^sample_name\s+"([^"]*)"', joined, re.MULTILINE)
    return (name[1] if name else ""), parts


def _split(file: FilePath) -> tuple[list[str], Float64]:
    header: list[str] = []
    rows: list[list[float]] = []
    for number, line in enumerate(file.read_text(encoding="utf-8", errors="replace").splitlines(), start=1):
        if line.startswith("#"):
            header.append(line[1:].strip())
        elif line.strip():
            try:
                rows.append([float(word) for word in line.replace(",", " ").split()])
            except ValueError:
                raise InputError(
                    "is not a row of numbers", file=file, field=f"line {number}", value=line[:60]
                ) from None
            if len(rows[-1]) != len(rows[0]) or not all(map(math.isfinite, rows[-1])):
                value = line[:60]
                raise InputError("is not like the rows before", file=file, field=f"line {number}", value=value)
    if not rows:
        raise InputError("holds no measurement", file=file)
    return header, np.array(rows)


def _incident_angles(header: str, file: FilePath) -> tuple[float, float]:
    both = re.search(r"^incident_angle\s+(\S+)\s+(\S+)", header, re.MULTILINE)
    theta = _finite(both[1], "incident_angle", file) if both else _number(header, "intheta", file)
    phi = _finite(both[2], "incident_angle", file) if both else _number(header, "inphi", file)
    if theta is None or phi is None:
        remedy = "The header has #intheta and #inphi, or #incident_angle THETA PHI, in degrees"
        raise InputError("is missing", file=file, field="incident angle", remedy=remedy)
    if not 0 <= theta <= 180:
        raise InputError("is outside 0..180 degrees", file=file, field="incident theta", value=theta)
    return theta, phi


def _number(header: str, name: str, file: FilePath) -> float | None:
    found = re.search(rf"^{name}\s+(\S+)", header, re.MULTILINE)
    return None if found is None else _finite(found[1], name, file)


def _finite(text: str, name: str, file: FilePath) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError("is not a number", file=file, field=f"#{name}", value=text)
    return value


def _direction(theta_deg: Float64, phi_deg: Float64) -> Float64:
    theta, phi = np.radians(theta_deg), np.radians(phi_deg)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)


def _square_directions() -> tuple[Float64, float]:
    """Directions of equal projected solid angle (N, 3), and that solid angle [sr]."""
    places = (np.arange(SQUARE_SIDE) + 0.5) / SQUARE_SIDE
    u, v = np.meshgrid(places, places, indexing="ij")
    xy = disc_from_square(u.ravel(), v.ravel())
    z = np.sqrt(np.maximum(0.0, 1 - (xy**2).sum(1)))
    return np.column_stack([xy, z]), np.pi / SQUARE_SIDE**2
