"""What physics asks of a product's tables: reciprocity, energy, and front and back that agree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from transom.bsdf.bsdf import Bsdf, Path, Spectrum
from transom.bsdf.directions import KLEMS_FULL

ENERGY_SLACK = 0.01
"""Of 1: hemispherical values from Monte Carlo sampling pass 1 by so much without being wrong."""

RECIPROCITY_SLACK = 0.05
"""Flux out of place, as a share of the flux, that the noise of simulated tables explains."""


@dataclass(frozen=True)
class Finding:
    """One check: what was asked, what was found, as a share of flux, and whether that is within the bound."""

    check: str
    spectrum: str
    path: str
    value: float
    bound: float
    holds: bool
    words: str


def check_bsdf(product: Bsdf) -> list[Finding]:
    """All checks that the product's tables allow, in the order of its spectra and paths."""
    findings: list[Finding] = []
    for spectrum in Spectrum:
        tables = {
            path: product.scattering[spectrum, path].klems(KLEMS_FULL)
            for path in Path
            if (spectrum, path) in product.scattering
        }
        sums = {path: KLEMS_FULL.projected_solid_angles @ values for path, values in tables.items()}
        for path, by_incidence in sums.items():
            worst = float(by_incidence.max())
            x, y, z = KLEMS_FULL.centres[int(by_incidence.argmax())]
            where = f"theta {np.degrees(np.arccos(z)):.3g}, phi {np.degrees(np.arctan2(y, x)) % 360:.3g}"
            findings.append(
                Finding(
                    "energy",
                    spectrum,
                    path,
                    worst,
                    1 + ENERGY_SLACK,
                    worst <= 1 + ENERGY_SLACK,
                    f"leaves at most {worst:.4f} of the light of an incidence ({where})",
                )
            )
        for sent, back in (
            (Path.transmission_front, Path.reflection_front),
            (Path.transmission_back, Path.reflection_back),
        ):
            if sent in sums and back in sums:
                worst = float((sums[sent] + sums[back]).max())
                words = f"transmitted and reflected together are at most {worst:.4f}"
                findings.append(
                    Finding(
                        "energy",
                        spectrum,
                        f"{sent} + {back}",
                        worst,
                        1 + ENERGY_SLACK,
                        worst <= 1 + ENERGY_SLACK,
                        words,
                    )
                )
        for path, values in tables.items():
            if path is Path.transmission_back and Path.transmission_front in tables:
                continue  # the same pair again
            if path.reverse in tables:
                findings.append(_reciprocity(spectrum, path, values, tables[path.reverse]))
        if Path.transmission_front in sums and Path.transmission_back in sums:
            findings.append(_front_back(spectrum, sums))
    return findings


def _reciprocity(spectrum: Spectrum, path: Path, forth: np.ndarray, back: np.ndarray) -> Finding:
    """Light turned round takes the same way: f(i -> o) = f'(-o -> -i) [Helmholtz]."""
    weight = np.outer(KLEMS_FULL.projected_solid_angles, KLEMS_FULL.projected_solid_angles)
    turned = back[np.ix_(KLEMS_FULL.opposite, KLEMS_FULL.opposite)].T
    flux = float((weight * (forth + turned)).sum()) / 2
    moved = float((weight * np.abs(forth - turned)).sum()) / 2
    share = moved / flux if flux > 0 else 0.0
    words = f"{100 * share:.2f} % of the flux goes elsewhere when light is turned round"
    name = str(path) if path.reverse is path else f"{path} / {path.reverse}"
    return Finding("reciprocity", spectrum, name, share, RECIPROCITY_SLACK, share <= RECIPROCITY_SLACK, words)


def _front_back(spectrum: Spectrum, sums: dict[Path, np.ndarray]) -> Finding:
    """Diffuse-diffuse transmittances of the two ways are equal by reciprocity; direct ones at normal incidence too
    where a product is symmetric: only the first is asked for."""
    front, back = (
        float(sums[path] @ KLEMS_FULL.projected_solid_angles) / np.pi
        for path in (Path.transmission_front, Path.transmission_back)
    )
    larger = max(front, back)
    share = abs(front - back) / larger if larger > 0 else 0.0
    words = f"diffuse transmittance is {front:.4f} from the front and {back:.4f} from the back"
    name = f"{Path.transmission_front} / {Path.transmission_back}"
    return Finding("front and back", spectrum, name, share, RECIPROCITY_SLACK, share <= RECIPROCITY_SLACK, words)
