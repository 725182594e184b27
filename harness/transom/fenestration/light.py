"""The light of one condition behind the products of a scene: what engine and references are both given."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from transom.daylight.condition import Condition
from transom.fenestration.load import load_fenestration
from transom.fenestration.panels import PanelGroup, panel_groups
from transom.glass import diffuse_reflectance
from transom.scene.model import Opening, ProductChoice, Scene

Float64 = NDArray[np.float64]

DIGEST_DIGITS = 4
"""Decimals to which shares of the arriving light, and directions, agree if they count as the same light."""

PROBES = ((0.0, 0.0, 1.0), (0.48, 0.36, 0.8), (0.352, -0.6, 0.7184))
"""Incident directions at which a product shows what it is: from the front, from below and from above."""


@dataclass(frozen=True)
class PanelBeam:
    """Parallel light that a panel sends into the room from wherever the sun reaches it.

    direction: unit direction of propagation in the world (3,). normal_illuminance_rgb: (3,) [lx], on a plane across it.
    """

    direction: Float64
    normal_illuminance_rgb: Float64


@dataclass(frozen=True)
class PanelLight:
    """The sun behind one panel group (transom.fenestration.panels), per panel that is wholly in the sun.

    group: index into panel_groups(scene). beams: one a lobe. residual_rgb: (B, 3), radiance of the panel into each exit
    bin [cd/m²].
    """

    group: int
    beams: tuple[PanelBeam, ...]
    residual_rgb: Float64


def panel_light(scene: Scene, condition: Condition) -> tuple[PanelLight, ...]:
    """What the sun becomes behind every panel group that it shines on. Empty without sun, or without products."""
    if condition.sun_direction is None:
        return ()
    lights: list[PanelLight] = []
    for index, group in enumerate(panel_groups(scene)):
        incident = group.to_panel(-condition.sun_direction)
        if incident[2] <= 0:
            continue
        fenestration = load_fenestration(_product(scene, group))
        through = fenestration.sun(incident)
        on_panel_rgb = condition.sun_illuminance_rgb * incident[2]
        beams = tuple(
            PanelBeam(group.to_world(lobe.direction), on_panel_rgb * (lobe.share / lobe.direction[2]))
            for lobe in through.lobes
        )
        per_bin = through.residual / fenestration.basis.projected_solid_angles
        lights.append(PanelLight(index, beams, per_bin[:, None] * on_panel_rgb))
    return tuple(lights)


def light_digest(scene: Scene, condition: Condition) -> str | None:
    """SHA-256 (hex) of what products make of light under a condition, None for a scene without products.

    Part of the key of every run, since references declare a version and not what products are traced to. Directions of
    PROBES stand for the table of all directions, which some products take seconds to trace. Numbers are rounded, so
    that another processor's last digits are the same light.
    """
    groups = panel_groups(scene)
    if not groups:
        return None
    digest = hashlib.sha256()
    for group in groups:
        fenestration = load_fenestration(_product(scene, group))
        _add(digest, fenestration.basis.edges_deg, fenestration.basis.counts)
        sun = condition.sun_direction
        incident = [] if sun is None else [group.to_panel(-sun)]
        for direction in [*(np.array(probe) for probe in PROBES), *incident]:
            if direction[2] <= 0:
                continue
            through = fenestration.sun(direction)
            _add(digest, through.residual)
            for lobe in through.lobes:
                _add(digest, lobe.direction, lobe.share)
    return digest.hexdigest()


def room_reflectance(opening: Opening) -> float:
    """Hemispherical-hemispherical reflectance of the opening's room side, 0..1, whatever it is glazed with."""
    return load_fenestration(opening.product).room_reflectance() if opening.product else diffuse_reflectance(opening)


def _product(scene: Scene, group: PanelGroup) -> ProductChoice:
    product = scene.openings[group.opening].product
    assert product is not None
    return product


def _add(digest: hashlib._Hash, *numbers: ArrayLike) -> None:
    for values in numbers:
        rounded = np.round(np.asarray(values, np.float64), DIGEST_DIGITS) + 0.0
        digest.update(rounded.astype("<f8").tobytes())
