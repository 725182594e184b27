"""A product's scattering: functions between directions, by path of light and spectrum."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from transom.bsdf.directions import AngleBasis
from transom.errors import InputError

Float64 = NDArray[np.float64]


class Path(StrEnum):
    """Where light comes from and where it goes, as in the files of LBNL's WINDOW: front is outdoors, back the room."""

    transmission_front = "Transmission Front"  # outdoors -> room
    transmission_back = "Transmission Back"  # room -> outdoors
    reflection_front = "Reflection Front"  # outdoors -> outdoors
    reflection_back = "Reflection Back"  # room -> room

    @property
    def incident_sign(self) -> int:
        """Sign of z of incident propagation: +1 from outdoors, -1 from the room."""
        return 1 if self in (Path.transmission_front, Path.reflection_front) else -1

    @property
    def exit_sign(self) -> int:
        """Sign of z of the light that leaves: +1 into the room."""
        return self.incident_sign if "Transmission" in self else -self.incident_sign

    @property
    def reverse(self) -> Path:
        """The path of the same light turned back."""
        pairs = {Path.transmission_front: Path.transmission_back, Path.transmission_back: Path.transmission_front}
        return pairs.get(self, self)


class Spectrum(StrEnum):
    """Weighting of a table over wavelengths."""

    visible = "Visible"
    solar = "Solar"


class Scattering(Protocol):
    """A BTDF or BRDF [1/sr] between directions of propagation; signs of z do not count."""

    def evaluate(self, incident: Float64, leaving: Float64) -> Float64:
        """Values for pairs of unit directions (..., 3)."""
        ...

    def hemispherical(self, incident: Float64) -> Float64:
        """Share of the light incident from each direction (..., 3) that leaves in all: integral of f cos(theta)."""
        ...

    def klems(self, basis: AngleBasis) -> Float64:
        """Mean values over bins, (leaving, incident) [1/sr]."""
        ...


@dataclass(frozen=True)
class KlemsMatrix:
    """Values (B, B) [1/sr]: row = leaving bin, column = incident bin."""

    basis: AngleBasis
    values: Float64

    def evaluate(self, incident: Float64, leaving: Float64) -> Float64:
        return np.asarray(self.values[self.basis.bin_of(leaving), self.basis.bin_of(incident)])

    def hemispherical(self, incident: Float64) -> Float64:
        return np.asarray(self.by_incidence()[self.basis.bin_of(incident)])

    def by_incidence(self) -> Float64:
        """Hemispherical value of each incident bin (B,)."""
        return np.asarray(self.basis.projected_solid_angles @ self.values)

    def klems(self, basis: AngleBasis) -> Float64:
        if basis != self.basis:
            raise ValueError(f"values on {self.basis.name} are not converted to {basis.name}")
        return self.values


@dataclass(frozen=True)
class Bsdf:
    """A product as read from a file or traced. thickness_m: 0 where unknown. notes: what a reader should know."""

    name: str
    manufacturer: str
    source: str
    scattering: Mapping[tuple[Spectrum, Path], Scattering]
    thickness_m: float = 0.0
    notes: tuple[str, ...] = field(default=())

    def get(self, path: Path, spectrum: Spectrum = Spectrum.visible) -> Scattering:
        """One function. A transmission that the file lacks is its reverse turned round (Helmholtz reciprocity).

        Raises InputError when neither is there.
        """
        found = self.scattering.get((spectrum, path))
        if found is not None:
            return found
        reverse = self.scattering.get((spectrum, path.reverse))
        if reverse is not None and path.reverse is not path:
            return Reversed(reverse)
        there = ", ".join(f"{s} {p}" for s, p in self.scattering) or "nothing"
        raise InputError(f"has no {spectrum} {path}", file=self.source, remedy=f"It holds {there}")


@dataclass(frozen=True)
class Reversed:
    """A function seen with light going the other way: f'(i -> o) = f(-o -> -i)."""

    forward: Scattering

    def evaluate(self, incident: Float64, leaving: Float64) -> Float64:
        return self.forward.evaluate(-np.asarray(leaving), -np.asarray(incident))

    def hemispherical(self, incident: Float64) -> Float64:
        directions, weights = _disc_grid()
        turned = np.asarray(incident)[..., None, :]
        values = self.evaluate(np.broadcast_to(turned, (*turned.shape[:-2], len(directions), 3)), directions)
        return np.asarray(values @ weights)

    def klems(self, basis: AngleBasis) -> Float64:
        turned = self.forward.klems(basis)[np.ix_(basis.opposite, basis.opposite)]
        return np.asarray(turned.T)


def _disc_grid(side: int = 64) -> tuple[Float64, Float64]:
    """Directions (side², 3) of equal projected solid angle, and that solid angle (side²,) [sr]."""
    from transom.bsdf.directions import disc_from_square

    places = (np.arange(side) + 0.5) / side
    u, v = np.meshgrid(places, places, indexing="ij")
    xy = disc_from_square(u.ravel(), v.ravel())
    z = np.sqrt(np.maximum(0.0, 1 - (xy**2).sum(axis=1)))
    return np.column_stack([xy, z]), np.full(side * side, np.pi / (side * side))
