"""Openings with a glazing product, as tables for the portal integrator: frames, BTDF by exit bin, residual, beams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from transom.colour import luminance
from transom.daylight.condition import Condition
from transom.fenestration.light import panel_light
from transom.fenestration.load import load_fenestration
from transom.fenestration.panels import PanelGroup, panel_groups
from transom.fenestration.through import Fenestration
from transom.scene.model import Scene
from transom_reference.mitsuba_setup import dr, floats, mi

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]


@dataclass(frozen=True)
class Beam:
    """Parallel light that panels of one group send into the room. direction: of propagation. normal_rgb: (3,) [lx]."""

    group: int
    direction: Float64
    normal_rgb: Float64


@dataclass(frozen=True)
class Panels:
    """Products in openings under one condition; B is the largest bin count, R the largest ring count of their bases.

    fenestrations: by group. group_of_portal: (P,), -1 for a portal without product. residual: (G, B, 3) [cd/m²], of
    panels in full sun.
    group_table: flat (G, 16): x axis, first row of the product in `share`; y axis, first ring; z axis, bin count; 0.
    edges: flat (products, R + 1), squared sines. rings: flat (products, R, 2): bins of the ring, first bin.
    share: flat (products, B): by exit bin, its part of T from all incident bins. cumulated: flat (products, B, B), by
    exit bin the share up to each incident bin, normalised. ring_of_bin: flat (products, B).
    """

    groups: tuple[PanelGroup, ...]
    beams: tuple[Beam, ...]
    group_of_portal: Int64
    residual: Float64
    fenestrations: tuple[Fenestration, ...]
    ring_count: int
    bin_count: int
    portal_group: Any
    group_table: Any
    edges: Any
    rings: Any
    ring_of_bin: Any
    share: Any
    cumulated: Any
    residual_table: Any
    beam_table: Any

    def mean_luminance(self, portal: int, outward: Float64, radiance: Float64) -> float:
        """What a panel sends into the room, mean over cosine-weighted directions [cd/m²].

        outward: world directions (N, 3) distributed by the cosine; radiance: (N,) that arrives from them [cd/m²].
        """
        index = int(self.group_of_portal[portal])
        group, basis = self.groups[index], self.fenestrations[index].basis
        weights = basis.projected_solid_angles
        passed = weights @ self.fenestrations[index].transmission()
        residual = np.asarray(luminance(self.residual[index, : basis.count]))
        return float((radiance * passed[basis.bin_of(group.to_panel(-outward))]).mean() + residual @ weights / np.pi)


def build_panels(scene: Scene, condition: Condition, faces_of_portals: Sequence[int]) -> Panels | None:
    """Tables of a scene's products, or None where it has none. faces_of_portals: row of Mesh.faces of each portal."""
    groups = panel_groups(scene)
    if not groups:
        return None
    choices = [scene.openings[group.opening].product for group in groups]
    products = {choice: load_fenestration(choice) for choice in choices if choice is not None}
    order = {choice: index for index, choice in enumerate(products)}
    bases = [fenestration.basis for fenestration in products.values()]
    ring_count, bin_count = max(len(basis.counts) for basis in bases), max(basis.count for basis in bases)

    edges = np.full((len(bases), ring_count + 1), 2.0)
    rings = np.ones((len(bases), ring_count, 2))
    ring_of_bin = np.zeros((len(bases), bin_count))
    share, cumulated = np.zeros((len(bases), bin_count)), np.ones((len(bases), bin_count, bin_count))
    for index, (basis, fenestration) in enumerate(zip(bases, products.values(), strict=True)):
        count = len(basis.counts)
        edges[index, : count + 1] = np.sin(np.radians(basis.edges_deg)) ** 2
        rings[index, :count, 0] = basis.counts
        rings[index, :count, 1] = np.concatenate([[0], np.cumsum(basis.counts)[:-1]])
        ring_of_bin[index, : basis.count] = np.repeat(np.arange(count), basis.counts)
        parts = fenestration.transmission() * basis.projected_solid_angles
        share[index, : basis.count] = parts.sum(axis=1)
        sums = np.cumsum(parts, axis=1) / np.maximum(parts.sum(axis=1, keepdims=True), 1e-30)
        cumulated[index, : basis.count, : basis.count] = sums
        cumulated[index, :, basis.count - 1 :] = 1.0

    residual = np.zeros((len(groups), bin_count, 3))
    beams: list[Beam] = []
    for light in panel_light(scene, condition):
        residual[light.group, : len(light.residual_rgb)] = light.residual_rgb
        lit = (beam for beam in light.beams if beam.normal_illuminance_rgb.max() > 0)
        beams += [Beam(light.group, beam.direction, beam.normal_illuminance_rgb) for beam in lit]
    rows = []
    for group, choice in zip(groups, choices, strict=True):
        product = order[choice] if choice is not None else 0
        x, y, z = group.axes
        offsets = (product * bin_count, product * ring_count, bases[product].count)
        rows.append([*x, offsets[0], *y, offsets[1], *z, offsets[2], 0, 0, 0, 0])
    group_of_face = {int(face): index for index, group in enumerate(groups) for face in group.faces}
    group_of_portal = np.array([group_of_face.get(int(face), -1) for face in faces_of_portals], dtype=np.int64)
    beam_rows = np.array([[*beam.direction, beam.group, *beam.normal_rgb, 0.0] for beam in beams])
    return Panels(
        groups,
        tuple(beams),
        group_of_portal,
        residual,
        tuple(products[choice] for choice in choices if choice is not None),
        ring_count,
        bin_count,
        floats(group_of_portal),
        floats(np.array(rows)),
        floats(edges),
        floats(rings),
        floats(ring_of_bin),
        floats(share),
        floats(cumulated),
        floats(residual),
        floats(beam_rows) if beams else None,
    )


@dataclass
class PanelSide:
    """The room side of panels where rays meet them, by lane. active: the lane is at a panel.

    group: UInt32. exit_bin: bin of the light that leaves against the ray. share: of that bin, 0..1.
    """

    active: Any
    group: Any
    exit_bin: Any
    share: Any


def panel_side(panels: Panels, portal: Any, direction: Any, active: Any) -> PanelSide:
    """The panel that is a portal, seen along `direction` from its room side; active lanes without product drop out."""
    number = dr.gather(mi.Float, panels.portal_group, portal, active)
    at_panel = active & (number >= 0.0)
    group = mi.UInt32(dr.maximum(number, 0.0))
    x, y = (dr.gather(mi.Vector4f, panels.group_table, group * 4 + k, at_panel) for k in range(2))
    leaving = -direction
    exit_bin = _bin_of(panels, mi.UInt32(y.w), dr.dot(leaving, x.xyz), dr.dot(leaving, y.xyz), at_panel)
    share = dr.gather(mi.Float, panels.share, mi.UInt32(x.w) + exit_bin, at_panel)
    return PanelSide(at_panel, group, exit_bin, dr.select(at_panel, share, 0.0))


def residual(panels: Panels, side: PanelSide) -> Any:
    """Radiance of the sun's residual in a panel's exit bin, for a panel in full sun, RGB [cd/m²]."""
    row = side.group * panels.bin_count + side.exit_bin
    return mi.Color3f(*(dr.gather(mi.Float, panels.residual_table, row * 3 + k, side.active) for k in range(3)))


def outward_direction(panels: Panels, side: PanelSide, u: Any, v: Any) -> Any:
    """Where light that leaves in the exit bin came from, as a direction outwards: drawn by T(exit, i) cos(theta).

    A radiance seen along it, times the bin's share, is an unbiased estimate of the panel's radiance.
    """
    x, y, z = (dr.gather(mi.Vector4f, panels.group_table, side.group * 4 + k, side.active) for k in range(3))
    first_row, first_ring = mi.UInt32(x.w), mi.UInt32(y.w)
    row = (first_row + side.exit_bin) * panels.bin_count
    low, high = mi.UInt32(0), mi.UInt32(z.w) - 1
    for _ in range(int(np.ceil(np.log2(panels.bin_count)))):
        middle = (low + high) // 2
        beyond = dr.gather(mi.Float, panels.cumulated, row + middle, side.active) <= u
        low, high = dr.select(beyond, dr.minimum(middle + 1, high), low), dr.select(beyond, high, middle)
    above = dr.gather(mi.Float, panels.cumulated, row + low, side.active)
    below = dr.select(
        low > 0, dr.gather(mi.Float, panels.cumulated, row + dr.maximum(low, 1) - 1, side.active & (low > 0)), 0.0
    )
    rest = dr.clip((u - below) / dr.maximum(above - below, 1e-12), 0.0, 1.0)
    ring = mi.UInt32(dr.gather(mi.Float, panels.ring_of_bin, first_row + low, side.active))
    edge = first_ring + first_ring // panels.ring_count + ring
    inner, outer = (dr.gather(mi.Float, panels.edges, edge + k, side.active) for k in (0, 1))
    count, first = (dr.gather(mi.Float, panels.rings, (first_ring + ring) * 2 + k, side.active) for k in (0, 1))
    square = dr.lerp(inner, outer, rest)
    phi = (mi.Float(low) - first + v - 0.5) * (2 * np.pi) / count
    sine = dr.sqrt(square)
    arriving = sine * dr.cos(phi) * x.xyz + sine * dr.sin(phi) * y.xyz + dr.sqrt(1.0 - square) * z.xyz
    return -mi.Vector3f(arriving)


def _bin_of(panels: Panels, first_ring: Any, x: Any, y: Any, active: Any) -> Any:
    """Bin of a direction by its x and y in the product's frame (transom.bsdf.directions.AngleBasis.bin_of)."""
    square = dr.square(x) + dr.square(y)
    row = first_ring + first_ring // panels.ring_count
    ring = mi.UInt32(0)
    for edge in range(1, panels.ring_count):
        beyond = square >= dr.gather(mi.Float, panels.edges, row + edge, active)
        ring = ring + dr.select(beyond, mi.UInt32(1), mi.UInt32(0))
    count, first = (dr.gather(mi.Float, panels.rings, (first_ring + ring) * 2 + k, active) for k in (0, 1))
    turn = dr.atan2(y, x) * (1 / (2 * np.pi)) * count + 0.5
    turn = dr.select(turn < 0.0, turn + count, turn)
    return mi.UInt32(first + dr.minimum(dr.floor(turn), count - 1.0))
