"""A room to compare what panels do: where on its floor and desks light of a direction lands, in closed form.

A box like scenes/test_room with a panel high in its south wall, seen in the panel's frame: x to the right, y up,
z into the room, the origin on the floor below the middle of the panel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from transom.bsdf.directions import AngleBasis
from transom.fenestration.bins import directions_within
from transom.fenestration.through import SunThrough

Float64 = NDArray[np.float64]

STRIPS = 128
"""Of the panel, level ones, in each of which the landing area is taken as parallel to the walls."""

BIN_SAMPLES = 64
"""Directions within an exit bin over which the residual's landing is averaged."""


@dataclass(frozen=True)
class Target:
    """A level rectangle at `height` [m], from low to high (x, z)."""

    name: str
    height: float
    low: tuple[float, float]
    high: tuple[float, float]

    @property
    def area(self) -> float:
        return (self.high[0] - self.low[0]) * (self.high[1] - self.low[1])


WIDTH, DEPTH, HEIGHT = 5.0, 6.0, 3.0
PANEL_WIDTH, PANEL_LOW, PANEL_HIGH = 3.0, 2.0, 2.9
PANEL_AREA = PANEL_WIDTH * (PANEL_HIGH - PANEL_LOW)
TARGETS = (
    Target("floor", 0.0, (-2.5, 0.0), (2.5, 6.0)),
    Target("desk near the window", 0.75, (-0.8, 1.1), (0.8, 1.9)),
    Target("desk in the middle", 0.75, (-0.8, 2.6), (0.8, 3.4)),
    Target("desk at the back", 0.75, (-0.8, 4.1), (0.8, 4.9)),
)
REFLECTANCE = 0.5
"""Mean of the room's surfaces, for its interreflected light."""


def landing(directions: Float64) -> Float64:
    """Share of the light that leaves the panel along each direction (N, 3) that lands on each target: (N, 4).

    The panel's level strips are laid down along the light; strips are cut exactly by a target's edges, in y and in x
    at their middle.
    """
    d = np.asarray(directions, np.float64)
    shares = np.zeros((len(d), len(TARGETS)))
    falling = np.flatnonzero((d[:, 1] < -1e-9) & (d[:, 2] > 1e-9))
    run, drift = -d[falling, 2] / d[falling, 1], -d[falling, 0] / d[falling, 1]  # z and x gone for each metre down
    places = (np.arange(STRIPS) + 0.5) / STRIPS
    for column, target in enumerate(TARGETS):
        low = np.clip(target.height + target.low[1] / run, PANEL_LOW, PANEL_HIGH)
        high = np.clip(target.height + target.high[1] / run, PANEL_LOW, PANEL_HIGH)
        y = low[:, None] + (high - low)[:, None] * places
        shift = drift[:, None] * (y - target.height)
        left = np.maximum(shift - PANEL_WIDTH / 2, target.low[0])
        right = np.minimum(shift + PANEL_WIDTH / 2, target.high[0])
        across = np.maximum(0.0, right - left).mean(axis=1) / PANEL_WIDTH
        shares[falling, column] = across * (high - low) / (PANEL_HIGH - PANEL_LOW)
    return shares


def bin_landing(basis: AngleBasis) -> Float64:
    """The same for light spread evenly over each bin (B, 4)."""
    within = directions_within(basis, BIN_SAMPLES)
    shares = landing(within.reshape(-1, 3)).reshape(basis.count, BIN_SAMPLES, len(TARGETS))
    return np.asarray(shares.mean(axis=1))


def landed(directions: Float64, flux: Float64) -> Float64:
    """Exits (N, 3) with their flux (N,): the flux on each target, directly (4,)."""
    return np.asarray(flux @ landing(directions))


def landed_represented(through: SunThrough, bins: Float64) -> Float64:
    """Lobes and residual: the flux on each target, directly (4,). bins: bin_landing of the basis."""
    total = through.residual @ bins
    if through.lobes:
        lobes = through.parallel_lobes
        total = total + np.array([lobe.share for lobe in lobes]) @ landing(np.array([lobe.direction for lobe in lobes]))
    return np.asarray(total)


def illuminance(direct: Float64, total: float) -> Float64:
    """Illuminance of each target per unit illuminance on the panel (4,): direct flux (4,) over its area, and light
    interreflected in the room as in an integrating sphere, of all the flux that entered."""
    surfaces = 2 * (WIDTH * DEPTH + WIDTH * HEIGHT + DEPTH * HEIGHT)
    everywhere = total * REFLECTANCE / (surfaces * (1 - REFLECTANCE))
    areas = np.array([target.area for target in TARGETS])
    return np.asarray(PANEL_AREA * (direct / areas + everywhere))
