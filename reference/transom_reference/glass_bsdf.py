"""Glass for Mitsuba's own integrators: the shared angular transmittance straight through, a diffuse room side.

Plugin `transom_glass`; its front looks outdoors.
    table           number of a pane that `glass_bsdf` has registered: transmittance at cos(theta) = i / 1024, linear
                    between, and the hemispherical reflectance of the back, which reflects diffusely
Use it with `volpath`: `path` loses a delta sun behind glass.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from transom_reference.mitsuba_setup import dr, mi

INVERSE_PI = float(1.0 / np.pi)
_TABLES: list[tuple[np.ndarray[Any, np.dtype[np.float32]], float]] = []


class GlassBSDF(mi.BSDF):
    """Two lobes: null transmission from both sides, diffuse reflection of the back."""

    def __init__(self, props: Any) -> None:
        super().__init__(props)
        values, room = _TABLES[int(props["table"])]
        self.table, self.room = mi.Float(values), float(room)
        self.intervals = len(values) - 1
        null = mi.BSDFFlags.Null | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        diffuse = mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.BackSide
        self.m_components = [null, diffuse]
        self.m_flags = null | diffuse

    def _passed(self, cosine: Any, active: Any) -> Any:
        position = dr.clip(dr.abs(cosine), 0.0, 1.0) * self.intervals
        entry = dr.minimum(mi.UInt32(position), self.intervals - 1)
        low = dr.gather(mi.Float, self.table, entry, active)
        return dr.lerp(low, dr.gather(mi.Float, self.table, entry + 1, active), position - mi.Float(entry))

    def _through_probability(self, cosine: Any, active: Any) -> Any:
        passed = self._passed(cosine, active)
        room = dr.select(cosine < 0.0, mi.Float(self.room), 0.0)
        return dr.select(room > 0.0, passed / (passed + room), 1.0)

    def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> tuple[Any, Any]:  # noqa: ARG002
        cosine = mi.Frame3f.cos_theta(si.wi)
        probability = self._through_probability(cosine, active)
        through = sample1 < probability
        local = mi.warp.square_to_cosine_hemisphere(sample2)
        bs = dr.zeros(mi.BSDFSample3f)
        bs.wo = dr.select(through, -si.wi, mi.Vector3f(local.x, local.y, -local.z))
        bs.pdf = dr.select(through, probability, (1.0 - probability) * local.z * INVERSE_PI)
        bs.eta = 1.0
        bs.sampled_type = dr.select(through, mi.UInt32(+mi.BSDFFlags.Null), mi.UInt32(+mi.BSDFFlags.DiffuseReflection))
        bs.sampled_component = dr.select(through, mi.UInt32(0), mi.UInt32(1))
        weight = dr.select(
            through, self._passed(cosine, active) / probability, self.room / dr.maximum(1.0 - probability, 1e-12)
        )
        return bs, mi.Color3f(weight) & active

    def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:  # noqa: ARG002
        cosine_i, cosine_o = mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
        inside = active & (cosine_i < 0.0) & (cosine_o < 0.0)
        return mi.Color3f(dr.select(inside, self.room * INVERSE_PI * -cosine_o, 0.0))

    def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:  # noqa: ARG002
        cosine_i, cosine_o = mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
        inside = active & (cosine_i < 0.0) & (cosine_o < 0.0)
        share = 1.0 - self._through_probability(cosine_i, active)
        return dr.select(inside, share * -cosine_o * INVERSE_PI, 0.0)

    def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def eval_null_transmission(self, si: Any, active: Any = True) -> Any:
        return mi.Color3f(self._passed(mi.Frame3f.cos_theta(si.wi), active))

    def traverse(self, callback: Any) -> None:
        """Nothing to differentiate."""

    def to_string(self) -> str:
        return f"GlassBSDF[room={self.room}]"


mi.register_bsdf("transom_glass", GlassBSDF)


def glass_bsdf(transmittance: Any, room: float) -> dict[str, Any]:
    """Plugin dictionary of a pane: transmittance (1025,), and the diffuse reflectance of its room side."""
    _TABLES.append((np.asarray(transmittance, dtype=np.float32), room))
    return {"type": "transom_glass", "table": len(_TABLES) - 1}
