"""The light of one condition behind the products of a scene: what engine and references are both given."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from transom.daylight.condition import Condition
from transom.fenestration.load import load_fenestration
from transom.fenestration.panels import panel_groups
from transom.glass import diffuse_reflectance
from transom.scene.model import Opening, Scene

Float64 = NDArray[np.float64]


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
        product = scene.openings[group.opening].product
        assert product is not None
        fenestration = load_fenestration(product)
        through = fenestration.sun(incident)
        on_panel_rgb = condition.sun_illuminance_rgb * incident[2]
        beams = tuple(
            PanelBeam(group.to_world(lobe.direction), on_panel_rgb * (lobe.share / lobe.direction[2]))
            for lobe in through.parallel_lobes
        )
        per_bin = through.residual / fenestration.basis.projected_solid_angles
        lights.append(PanelLight(index, beams, per_bin[:, None] * on_panel_rgb))
    return tuple(lights)


def room_reflectance(opening: Opening) -> float:
    """Hemispherical-hemispherical reflectance of the opening's room side, 0..1, whatever it is glazed with."""
    return load_fenestration(opening.product).room_reflectance() if opening.product else diffuse_reflectance(opening)
