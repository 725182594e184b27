"""The window room with a made-up product in its window, for tests: any table, lobes and residual."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from reference_rooms import window_room

from transom.bsdf.directions import KLEMS_FULL, AngleBasis
from transom.fenestration.through import Lobe, SunThrough
from transom.scene.model import ProductChoice, Scene

Float64 = NDArray[np.float64]


@dataclass(frozen=True)
class MadeUpProduct:
    """A Fenestration of given numbers; the sun is split into `lobes` and, if `spread`, what the table says besides."""

    matrix: Float64
    reflectance: float = 0.0
    lobes: tuple[Lobe, ...] = ()
    spread: bool = False

    @property
    def basis(self) -> AngleBasis:
        return KLEMS_FULL

    def transmission(self) -> Float64:
        return self.matrix

    def room_reflectance(self) -> float:
        return self.reflectance

    def sun(self, incident: Float64) -> SunThrough:
        column = self.matrix[:, int(KLEMS_FULL.bin_of(incident))] * KLEMS_FULL.projected_solid_angles
        return SunThrough(self.lobes, column if self.spread else np.zeros(KLEMS_FULL.count))


def lopsided_matrix(transmittance: float = 0.6, seed: int = 3) -> Float64:
    """A BTDF without any symmetry (145, 145) [1/sr]: light leaves up and to the left, in few bins for each incident."""
    generator = np.random.default_rng(seed)
    centres, weights = KLEMS_FULL.centres, KLEMS_FULL.projected_solid_angles
    turned = centres + np.array([-0.35, 0.5, 0.0])
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    matrix = np.exp(40.0 * (centres @ turned.T - 1.0)) * generator.uniform(0.2, 1.0, (145, 145))
    return np.asarray(matrix * (transmittance / (weights @ matrix)))


def product_room(product: MadeUpProduct, monkeypatch: pytest.MonkeyPatch) -> Scene:
    """reference_rooms.window_room with the product in its window, whatever the scene's file says."""
    for module in ("transom.fenestration.light", "transom_reference.panels", "transom_reference.mitsuba_scene"):
        monkeypatch.setattr(f"{module}.load_fenestration", lambda _choice: product)
    scene = window_room("none")
    choice = ProductChoice("made_up", (), "0" * 64)
    opening = replace(scene.openings[0], glazing="product", visible_transmittance=0.0, product=choice)
    return replace(scene, openings=(opening,))
