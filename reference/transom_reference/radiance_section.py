"""Sections of products as Radiance geometry, and Radiance's own BSDF of them (genBSDF, as pyradiance has it)."""

from __future__ import annotations

import itertools
import os
import tempfile
from pathlib import Path

import numpy as np

from transom.bsdf import Bsdf, read_bsdf
from transom.errors import InputError
from transom.products.section import Line, Section
from transom_reference.radiance_programs import radiance_folder

PERIODS = 240
"""Periods of geometry, of which only the middle one is sampled: Radiance knows no repetition."""

ARC_POINTS = 40
SLACK_M = 1e-5
"""Between the product and the box from whose faces genBSDF starts its rays."""

ORDER_LIMITS = ("-lr", "-40", "-lw", "1e-6", "-ab", "6", "-ad", "200")
"""Reflections: Russian roulette from 40 on, by rays that carry more than a millionth; diffuse ones as they come."""


def radiance_geometry(section: Section, periods: int = PERIODS) -> str:
    """The section's lines as polygons that run along x, in genBSDF's frame: the room side is just below z = 0.

    Interfaces with air become `dielectric`, which refracts, reflects and absorbs; mirrors become `metal`, diffuse lines
    `plastic`. Radiance averages the two polarisations at each surface. Raises InputError for gaps without width, holes
    and diffuse transmission, which have no such material.
    """
    high = section.depth[1]
    reach = 2 * periods * section.period_m
    parts: list[str] = []
    for number, line in enumerate(section.lines):
        parts.append(_material(f"m{number}", line, section.media))
        points = line.points(ARC_POINTS)
        for image in range(-periods // 2, periods // 2 + 1):
            for piece, (a, b) in enumerate(itertools.pairwise(points)):
                # Counter-clockwise from the left of a -> b, which is the front.
                low, far = [(y + image * section.period_m, z - high - SLACK_M) for y, z in (a, b)]
                corners = [(-reach, *low), (reach, *low), (reach, *far), (-reach, *far)]
                if line.kind == "interface" and line.left != 0:  # a dielectric's normal looks out of it
                    corners.reverse()
                numbers = " ".join(f"{value:.9g}" for corner in corners for value in corner)
                parts.append(f"m{number} polygon p{number}_{image + periods}_{piece} 0 0 12 {numbers}")
    return "\n".join(parts) + "\n"


def _material(name: str, line: Line, media: tuple[tuple[float, float], ...]) -> str:
    if line.kind == "interface" and 0 in (line.left, line.right):
        index, absorption = media[line.left or line.right]
        passed = float(np.exp(-absorption))  # of a metre
        return f"void dielectric {name} 0 0 5 {passed:.9g} {passed:.9g} {passed:.9g} {index:.9g} 0"
    rho = line.reflectance or line.reflectance_right
    if line.kind == "mirror" and line.openness == 0:
        return f"void metal {name} 0 0 5 {rho:.9g} {rho:.9g} {rho:.9g} 1 0"
    if line.kind == "diffuse" and line.openness == 0 and line.transmittance == 0:
        return f"void plastic {name} 0 0 5 {rho:.9g} {rho:.9g} {rho:.9g} 0 0"
    raise InputError("has no material in Radiance", field="kind", value=line.kind, remedy="Give gaps a width")


def radiance_bsdf(section: Section, samples: int, periods: int = PERIODS) -> Bsdf:
    """The product's BSDF on the Klems full basis by genBSDF. samples: rays for each bin of leaving light."""
    os.environ["RAYPATH"] = f".:{radiance_folder() / 'lib'}"
    from pyradiance import genbsdf

    low, high = section.depth
    side = section.period_m / 2
    box = genbsdf.SamplingBox(-side, side, 0.0, section.period_m, low - high - 2 * SLACK_M, 0.0)
    with tempfile.TemporaryDirectory() as folder:
        geometry = Path(folder) / "device.rad"
        geometry.write_text(radiance_geometry(section, periods))
        found = genbsdf.generate_bsdf(geometry, params=list(ORDER_LIMITS), nsamp=samples, dim=box, basis="kf")
        file = Path(folder) / "device.xml"
        file.write_bytes(genbsdf.generate_xml(vis_results=found, basis="kf"))
        return read_bsdf(file)
