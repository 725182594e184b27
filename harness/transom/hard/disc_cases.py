"""The sun as a disc where closed forms know its light: past an edge, through a slit, behind wires and louvres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from transom.colour import luminance
from transom.daylight.sun_disc import SUN_RADIUS_RAD
from transom.hard import changes
from transom.hard.changes import sunlit
from transom.hard.claims import Case, Claim, Lit, Seen, room_claims, same, value
from transom.hard.rooms import ROOM_M, WINDOW_M, Point, Room, quad, windowed_room
from transom.hard.shape_cases import louvre_room
from transom.hard.sun_cases import roof_light_room

Float64 = NDArray[np.float64]
Edge = tuple[Point, Point, Point]

GROUP = "sun"

COUNT = 37
"""Sub-suns of these cases."""

POINT_SHARE = COUNT**-0.75
"""Of the full sun, error at a point behind one edge: what N points of a disc leave of half planes in the worst
orientation falls with N^(-3/4) at best [Beck 1987]; of this pattern's 37 points it is 0.055. Twice as much for two."""

MEAN_SHARE = 0.005
"""The same on the mean over a penumbra: the pattern has the disc's centre, and its second moments within 0.1 %."""

PLACES = 161

LOW_SUN: Point = (0.3, -1.0, 0.5)
BLADES = 25


def unglazed_louvres() -> Room:
    """A room behind BLADES blades in its open window."""
    return replace(louvre_room(BLADES), openings={"glass": None})


def disc_cases() -> list[Case]:
    roof = roof_light_room()
    height = ROOM_M[2]
    edge = ((1.0, 1.5, height), (1.0, 3.5, height), (9.0, 2.5, height))
    far = ((1.012, 1.5, height), (1.012, 3.5, height), (9.0, 2.5, height))
    wire = [((x, 1.5, 2.9), (x, 3.5, 2.9), (9.0, 2.5, 2.9)) for x in (2.0, 2.004)]
    wired = roof.with_polygons(quad((2.0, 0.5, 2.9), (2.004, 0.5, 2.9), (2.004, 4.5, 2.9), (2.0, 4.5, 2.9)))
    overhead, oblique = (0.0, 0.0, 1.0), (-0.6, 0.4, 0.9)
    louvres = unglazed_louvres()
    lit = Lit(louvres, lambda condition: sunlit(condition, LOW_SUN), sun=COUNT)
    return [
        Case("disc past an edge", GROUP, (_penumbra(roof, overhead, [edge]),)),
        Case("disc past an edge, oblique", GROUP, (_penumbra(roof, oblique, [edge]),)),
        Case("disc through a slit", GROUP, (_penumbra(roof_light_room((1.0, 1.012)), overhead, [edge, far]),)),
        Case("disc behind a wire", GROUP, (_penumbra(wired, overhead, wire, blocked=True),)),
        Case("disc behind louvres", GROUP, (*_room(lit), _louvres(lit), *_automatic(louvres))),
    ]


def _room(lit: Lit) -> tuple[Claim, ...]:
    """What holds of every room in every light; but sub-suns are not their own mirror image."""
    mirrored = same(lit, changes.mirrored(), 2 * POINT_SHARE, "to what the pattern leaves of two edges")
    return tuple(mirrored if claim.name == mirrored.name else claim for claim in room_claims(lit))


def share_beyond(points: Float64, edge: Edge, sun: Float64) -> Float64:
    """Share (N,) of a uniform disc around the unit vector `sun` (3,) that points (N, 3) see beyond a straight edge.

    edge: two of its points, and one beyond it. The plane through a point and the edge divides the disc: exact but for
    the curvature of the sky over the disc, 1e-5 of it.
    """
    start, end, beyond = (np.array(point) for point in edge)
    across = np.cross(end - start, points - start)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    across *= np.sign(np.einsum("ij,ij->i", across, beyond - points))[:, None]
    offset = np.clip(np.arcsin(across @ sun) / SUN_RADIUS_RAD, -1.0, 1.0)
    share: Float64 = 0.5 + (np.arcsin(offset) + offset * np.sqrt(1 - offset**2)) / np.pi
    return share


def direct_share(lit: Lit, points: Float64) -> Float64:
    """Direct illuminance (N,) of upward sensors at points (N, 3), relative to the unobstructed sun's."""
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    parts = lit.engine.illuminance(points, normals, rays=16, opening_rays=16)
    assert lit.condition.sun_direction is not None
    full = float(luminance(lit.condition.sun_illuminance_rgb)) * lit.condition.sun_direction[2]
    found: Float64 = luminance(parts["direct"]) / full
    return found


def penumbra_places(edge: Edge, sun: Float64, height_m: float = 0.5) -> Float64:
    """Points (PLACES, 3) at a height along x, across the shadow of an edge's middle and beyond it on both sides."""
    middle = (np.array(edge[0]) + np.array(edge[1])) / 2
    way = (middle[2] - height_m) / sun[2]
    points = np.tile(middle - way * sun, (PLACES, 1))
    points[:, 0] += np.linspace(-2.5, 2.5, PLACES) * way * SUN_RADIUS_RAD
    return points


def _penumbra(room: Room, towards: Point, edges: Sequence[Edge], *, blocked: bool = False) -> Claim:
    """edges: light comes from beyond the first and not from beyond the second; blocked: the other way round."""
    lit = Lit(room, lambda condition: sunlit(condition, towards), sun=COUNT)

    def check() -> Seen:
        sun = lit.condition.sun_direction
        assert sun is not None
        points = penumbra_places(edges[0], sun)
        exact = share_beyond(points, edges[0], sun)
        for other in edges[1:]:
            exact = exact - share_beyond(points, other, sun)
        return _near(direct_share(lit, points), 1 - exact if blocked else exact, len(edges))

    return Claim("closed form", _expectation(len(edges)), check)


def _louvres(lit: Lit) -> Claim:
    """Along a line behind the blades, each of which hides what lies between its two edges."""

    def check() -> Seen:
        sun = lit.condition.sun_direction
        assert sun is not None
        x0, z0, x1, z1 = WINDOW_M
        pitch = (z1 - z0) / BLADES
        points = np.tile([1.4, 2.0, 0.0], (PLACES, 1))
        points[:, 2] = 0.7 + np.linspace(-pitch, pitch, PLACES)
        exact = np.ones(PLACES)
        for z in z0 + (np.arange(BLADES) + 0.5) * pitch:
            near, far = (
                ((x0, y, float(z)), (x1, y, float(z)), (x0, y, float(z) + 9.0)) for y in (0.01, 0.01 + 0.7 * pitch)
            )
            exact -= np.abs(share_beyond(points, near, sun) - share_beyond(points, far, sun))
        return _near(direct_share(lit, points), exact, 2)

    return Claim("closed form", _expectation(2), check)


def _near(found: Float64, exact: Float64, edge_count: int) -> Seen:
    worst, mean = float(np.abs(found - exact).max()), float((found - exact).mean())
    holds = worst <= edge_count * POINT_SHARE and abs(mean) <= MEAN_SHARE
    text = f"differs by {100 * worst:.2f} % of the full sun at most, {100 * mean:.2f} % on the mean; " + (
        f"closed form from {100 * exact.min():.1f} to {100 * exact.max():.1f} %"
    )
    return Seen(holds and float(np.ptp(exact)) > 0, text)


def _expectation(edge_count: int) -> str:
    worst = 100 * edge_count * POINT_SHARE
    return f"within {worst:.1f} % of the full sun at each of {PLACES} places, {100 * MEAN_SHARE:g} % on their mean"


def _automatic(louvres: Room) -> tuple[Claim, ...]:
    def count(room: Room) -> float:
        lit = Lit(room, lambda condition: sunlit(condition, LOW_SUN), sun="auto")
        return float(lit.engine.present_sun.sub_suns)

    return (
        value("sub-suns are chosen", "more than one behind louvres", lambda: count(louvres), 7, COUNT),
        value("a point is chosen", "one behind a plain window", lambda: count(windowed_room()), 1, 1),
    )
