"""A glazing product as a BSDF for Mitsuba's own integrators: its table, and its lobes of one sun as narrow cones.

Plugin `transom_panel`; its front looks outdoors.
    table           number of a product that `panel_bsdf` has registered
It shares no code with our portal integrator: bins are looked up on a fine grid of directions, and directions outwards
are drawn by the cosine alone, so that a fault of either shows as a difference. From outdoors it is black.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from transom.fenestration.panels import PanelGroup
from transom.fenestration.through import Fenestration, Lobe
from transom_reference.mitsuba_setup import dr, floats, mi

Float64 = NDArray[np.float64]

INVERSE_PI = float(1.0 / np.pi)
GRID = 1024
"""Cells of the direction grid along each side of the unit square that holds the disc of (x, y)."""

SUN_TOLERANCE = 1e-4
"""Chord within which a direction is the sun's, for which the lobes hold."""


@dataclass(frozen=True)
class SunLobes:
    """Lobes of one incident direction (3,), product's frame: light from there leaves by them and not by the table."""

    incident: Float64
    lobes: Sequence[Lobe]
    residual: Float64


_PANELS: list[tuple[Fenestration, PanelGroup, SunLobes | None]] = []


class PanelBSDF(mi.BSDF):
    """Diffuse reflection of the back, and transmission by the table, back to front."""

    def __init__(self, props: Any) -> None:
        super().__init__(props)
        fenestration, group, self.sun = _PANELS[int(props["table"])]
        self.room = float(fenestration.room_reflectance())
        self.axes = [mi.Vector3f(*map(float, row)) for row in group.axes]
        centre = (np.arange(GRID) + 0.5) / GRID * 2 - 1
        x, y = np.meshgrid(centre, centre, indexing="ij")
        z = np.sqrt(np.maximum(1e-9, 1 - x * x - y * y))
        self.bins = floats(fenestration.basis.bin_of(np.stack([x, y, z], axis=-1)))
        self.count = fenestration.basis.count
        self.btdf = floats(fenestration.transmission())
        if self.sun is not None:
            self.residual = floats(self.sun.residual / fenestration.basis.projected_solid_angles)
        through = mi.BSDFFlags.DiffuseTransmission | mi.BSDFFlags.BackSide
        reflected = mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.BackSide
        self.m_components = [through, reflected]
        self.m_flags = through | reflected
        self.through_probability = 1.0 / (1.0 + self.room)

    def _bin(self, direction: Any, active: Any) -> Any:
        x, y = dr.dot(direction, self.axes[0]), dr.dot(direction, self.axes[1])
        column, row = (mi.UInt32(dr.clip((part + 1.0) * (0.5 * GRID), 0.0, GRID - 1.0)) for part in (x, y))
        return mi.UInt32(dr.gather(mi.Float, self.bins, column * GRID + row, active))

    def _btdf(self, leaving: Any, arriving: Any, active: Any) -> Any:
        """For world directions of propagation into the room [1/sr]."""
        exit_bin = self._bin(leaving, active)
        value = dr.gather(mi.Float, self.btdf, exit_bin * self.count + self._bin(arriving, active), active)
        if self.sun is None:
            return value
        towards = [float(v) for v in self.sun.incident]
        sun = sum((part * axis for part, axis in zip(towards, self.axes, strict=True)), mi.Vector3f(0.0))
        is_sun = dr.squared_norm(arriving - sun) < SUN_TOLERANCE**2
        split = dr.gather(mi.Float, self.residual, exit_bin, active)
        for lobe in self.sun.lobes:
            half = 0.5 * lobe.width_rad
            # Integral of cos(theta) over a cone about a direction: pi sin²(half) times its own cosine.
            spread = lobe.share / (np.pi * np.sin(half) ** 2 * lobe.direction[2])
            parts = zip(lobe.direction, self.axes, strict=True)
            middle = sum((float(part) * axis for part, axis in parts), mi.Vector3f(0.0))
            chord = 2 * float(np.sin(0.5 * half))
            split = split + dr.select(dr.squared_norm(leaving - middle) < chord**2, float(spread), 0.0)
        return dr.select(is_sun, split, value)

    def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> tuple[Any, Any]:
        through = sample1 < self.through_probability
        local = mi.warp.square_to_cosine_hemisphere(sample2)
        bs = dr.zeros(mi.BSDFSample3f)
        bs.wo = dr.select(through, local, mi.Vector3f(local.x, local.y, -local.z))
        bs.pdf = self.pdf(ctx, si, bs.wo, active)
        bs.eta = 1.0
        kinds = mi.BSDFFlags.DiffuseTransmission, mi.BSDFFlags.DiffuseReflection
        bs.sampled_type = dr.select(through, *(mi.UInt32(+kind) for kind in kinds))
        bs.sampled_component = dr.select(through, mi.UInt32(0), mi.UInt32(1))
        value = self.eval(ctx, si, bs.wo, active)
        return bs, dr.select(bs.pdf > 0.0, value / dr.maximum(bs.pdf, 1e-20), 0.0)

    def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:  # noqa: ARG002
        cosine_i, cosine_o = mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
        from_room = active & (cosine_i < 0.0)
        passed = self._btdf(si.to_world(si.wi), -si.to_world(wo), from_room & (cosine_o > 0.0))
        value = dr.select(cosine_o > 0.0, passed, self.room * INVERSE_PI) * dr.abs(cosine_o)
        return mi.Color3f(dr.select(from_room, value, 0.0))

    def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:  # noqa: ARG002
        cosine_o = mi.Frame3f.cos_theta(wo)
        share = dr.select(cosine_o > 0.0, self.through_probability, 1.0 - self.through_probability)
        from_room = active & (mi.Frame3f.cos_theta(si.wi) < 0.0)
        return dr.select(from_room, share * dr.abs(cosine_o) * INVERSE_PI, 0.0)

    def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def traverse(self, callback: Any) -> None:
        """Nothing to differentiate."""

    def to_string(self) -> str:
        return f"PanelBSDF[room={self.room}]"


mi.register_bsdf("transom_panel", PanelBSDF)


def panel_bsdf(fenestration: Fenestration, group: PanelGroup, sun: SunLobes | None = None) -> dict[str, Any]:
    """Plugin dictionary of the panels of one group. sun: lobes of the sun; without, the table serves it too."""
    _PANELS.append((fenestration, group, sun))
    return {"type": "transom_panel", "table": len(_PANELS) - 1}
