"""Illuminance through a rectangular opening by product Gauss quadrature: sky, ground and screens, glazed or not.

The integrand is cut wherever it has an edge (the horizon, the edges of screens) or a cusp (the sun's place in the sky),
so that it is smooth within each panel; two orders of the rule tell how far it has converged.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Radiance = Callable[[Float64], Float64]

COARSE_ORDER, FINE_ORDER = 20, 28
"""Gauss-Legendre points a panel and direction; the difference of the two is taken as the uncertainty."""


@dataclass(frozen=True)
class Rectangle:
    """An axis-aligned rectangle: the coordinate `axis` (0 x, 1 y, 2 z) is `place` [m], the two others, in ascending
    order, lie in u and v [m]."""

    axis: int
    place: float
    u: tuple[float, float]
    v: tuple[float, float]

    @property
    def area(self) -> float:
        return (self.u[1] - self.u[0]) * (self.v[1] - self.v[0])

    def points(self, u: Float64, v: Float64) -> Float64:
        """Points (..., 3) at coordinates u, v of any equal shape."""
        first, second = (other for other in range(3) if other != self.axis)
        result = np.empty((*u.shape, 3))
        result[..., self.axis], result[..., first], result[..., second] = self.place, u, v
        return result


@dataclass(frozen=True)
class Screen:
    """Something of one luminance [cd/m²] that covers a rectangle of an opening's plane, as one point sees it."""

    u: tuple[float, float]
    v: tuple[float, float]
    luminance: Radiance | float

    def covers(self, u: float, v: float) -> bool:
        return self.u[0] <= u <= self.u[1] and self.v[0] <= v <= self.v[1]


@dataclass(frozen=True)
class Known:
    """A value and its uncertainty, in the same unit."""

    value: float
    uncertainty: float


def opening_illuminance(
    point: Float64,
    normal: Float64,
    opening: Rectangle,
    sky: Radiance,
    ground_cd_m2: float = 0.0,
    transmittance: Radiance | None = None,
    screens: Sequence[Screen] = (),
    cusp: Float64 | None = None,
) -> Known:
    """Illuminance [lx] of a point (3,) with unit normal (3,) from all that it sees through a rectangular opening.

    sky: luminance [cd/m²] of unit directions (..., 3) above the horizon. transmittance: of cosines of incidence;
    None: unglazed. cusp: direction (3,) where the sky is not smooth. The plane of the point may cut the opening only
    along the horizon (a horizontal sensor) or not at all.
    """
    cuts_u, cuts_v = list(opening.u), list(opening.v)
    for screen in screens:
        cuts_u += screen.u
        cuts_v += screen.v
    if opening.axis != 2:
        cuts_v.append(float(point[2]))
    if cusp is not None and (opening.place - point[opening.axis]) * cusp[opening.axis] > 0:
        met = point + cusp * (opening.place - point[opening.axis]) / cusp[opening.axis]
        first, second = (other for other in range(3) if other != opening.axis)
        cuts_u.append(float(met[first]))
        cuts_v.append(float(met[second]))
    panels = [
        (low_u, high_u, low_v, high_v)
        for low_u, high_u in _intervals(cuts_u, opening.u)
        for low_v, high_v in _intervals(cuts_v, opening.v)
    ]
    sums = []
    for order in (COARSE_ORDER, FINE_ORDER):
        node, weight = np.polynomial.legendre.leggauss(order)
        total = 0.0
        for low_u, high_u, low_v, high_v in panels:
            u = 0.5 * (low_u + high_u) + 0.5 * (high_u - low_u) * node
            v = 0.5 * (low_v + high_v) + 0.5 * (high_v - low_v) * node
            grid_u, grid_v = np.meshgrid(u, v, indexing="ij")
            places = opening.points(grid_u, grid_v)
            offsets = places - point
            distance = np.sqrt((offsets**2).sum(axis=-1))
            directions = offsets / distance[..., None]
            cosine = np.abs(directions[..., opening.axis])
            facing = np.maximum(directions @ normal, 0.0)
            centre_u, centre_v = 0.5 * (low_u + high_u), 0.5 * (low_v + high_v)
            hit = next((entry for entry in screens if entry.covers(centre_u, centre_v)), None)
            seen: Float64 | float
            if hit is not None:
                seen = hit.luminance(directions) if callable(hit.luminance) else hit.luminance
            elif opening.axis != 2 and centre_v < point[2]:
                seen = ground_cd_m2
            else:
                seen = sky(directions)
            passed = 1.0 if transmittance is None else transmittance(cosine)
            values = seen * passed * facing * cosine / distance**2
            total += float(0.25 * (high_u - low_u) * (high_v - low_v) * (weight @ values @ weight))
        sums.append(total)
    return Known(sums[1], abs(sums[1] - sums[0]) + 1e-12 * abs(sums[1]))


def parallel_screen(point: Float64, opening: Rectangle, screen: Rectangle, luminance: Radiance | float) -> Screen:
    """A screen parallel to an opening, beyond it, as it appears in the opening's plane from a point."""
    if screen.axis != opening.axis:
        raise ValueError("the screen is not parallel to the opening")
    share = (opening.place - point[opening.axis]) / (screen.place - point[opening.axis])
    first, second = (other for other in range(3) if other != opening.axis)
    u = tuple(float(point[first] + share * (edge - point[first])) for edge in screen.u)
    v = tuple(float(point[second] + share * (edge - point[second])) for edge in screen.v)
    return Screen((u[0], u[1]), (v[0], v[1]), luminance)


def overhang_screen(point: Float64, opening: Rectangle, overhang: Rectangle, luminance: Radiance | float) -> Screen:
    """A level overhang over an opening in a plane y = const, which starts at that plane, as it appears from a point.

    It must reach so far to both sides that only its front edge is seen through the opening. Raises ValueError if it
    does not, or if the point is not below it.
    """
    if opening.axis != 1 or overhang.axis != 2 or point[2] >= overhang.place:
        raise ValueError("an overhang is level, its opening in a plane y = const and the point below it")
    front = overhang.v[0] if point[1] > opening.place else overhang.v[1]
    share = (opening.place - point[1]) / (front - point[1])
    ends = [float(point[0] + share * (edge - point[0])) for edge in overhang.u]
    if ends[0] > opening.u[0] or ends[1] < opening.u[1]:
        raise ValueError("the overhang ends within the view through the opening")
    lowest = float(point[2] + share * (overhang.place - point[2]))
    return Screen((-math.inf, math.inf), (lowest, math.inf), luminance)


def _intervals(cuts: Sequence[float], limits: tuple[float, float]) -> list[tuple[float, float]]:
    inner = sorted({min(max(cut, limits[0]), limits[1]) for cut in cuts})
    return [(low, high) for low, high in pairwise(inner) if high - low > 1e-12]
