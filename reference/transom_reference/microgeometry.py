"""Light through the true geometry of a product: triangles of its section, Mitsuba's rays, Fresnel's amplitudes.

A second tracer of sections that shares no code with the engine's: the section is extruded into triangles, repeated over
many periods, and each particle carries one state of polarisation, drawn at random, as a complex field, so that total
reflection turns it and oblique facets mix it. Gaps are to be given as slits of some width.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from transom_reference.mitsuba_setup import dr, floats, mi

Float64 = NDArray[np.float64]

PERIODS = 40
"""Periods on either side of the one into which particles are put back after each hit."""

HALF_WIDTH = 40.0
"""Half the extruded length, in periods."""

STEP = 2e-5
"""Particles go on this far from a facet, in periods."""

MAX_HITS = 300


class SectionLine(Protocol):
    """A line between media (transom.products.section): interfaces, and mirrors of both sides."""

    kind: str
    left: int
    right: int
    reflectance: float
    reflectance_right: float

    def points(self, count: int = 24) -> Sequence[tuple[float, float]]: ...


class SectionGeometry(Protocol):
    """One period of a product: media as (index of refraction, absorption [1/m]), the first is air."""

    period_m: float
    media: tuple[tuple[float, float], ...]

    @property
    def lines(self) -> Sequence[SectionLine]: ...


@dataclass(frozen=True)
class Particles:
    """What became of particles: directions (N, 3) of those that left and their weights, shares of the incident flux.

    transmitted: z > 0. unfinished: share that was given up on or left sideways.
    """

    transmitted: Float64
    weights: Float64
    reflected_share: float
    absorbed: float
    unfinished: float

    @property
    def transmittance(self) -> float:
        return float(self.weights.sum())

    def binned(self, bins: NDArray[np.int64], count: int) -> tuple[Float64, Float64]:
        """Share of the incident flux by bin (count,) and its standard error, for each particle's bin (N,)."""
        share, squares = (np.bincount(bins, self.weights**power, count) for power in (1, 2))
        return np.asarray(share, np.float64), np.sqrt(squares)


class Microgeometry:
    """The triangles of a section, in units of its period. Raises ValueError for kinds of lines that it cannot trace."""

    def __init__(self, section: SectionGeometry) -> None:
        self.period = section.period_m
        self.media = section.media
        corners, facets = [], []
        for line in section.lines:
            if line.kind not in ("interface", "mirror"):
                raise ValueError(f"lines of kind {line.kind!r} have no geometry of their own here")
            ends = np.array(line.points(64)) / self.period
            is_mirror = float(line.kind == "mirror")
            for a, b in itertools.pairwise(ends):
                side = [line.left, line.right, is_mirror, line.reflectance, line.reflectance_right]
                for shift in range(-PERIODS, PERIODS + 1):
                    low, high = (a[0] + shift, a[1]), (b[0] + shift, b[1])
                    corners += [[-HALF_WIDTH, *low], [HALF_WIDTH, *low], [HALF_WIDTH, *high], [-HALF_WIDTH, *high]]
                    facets.append(side)
        vertices = np.array(corners)
        self.low, self.high = float(vertices[:, 2].min()), float(vertices[:, 2].max())
        first = 4 * np.arange(len(facets))[:, None]
        rows = (first + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3)
        mesh = mi.Mesh("section", vertex_count=len(vertices), face_count=len(rows))
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = mi.Float(vertices.astype(np.float32).ravel())
        parameters["faces"] = mi.UInt32(rows.astype(np.uint32).ravel())
        parameters.update()
        self.scene = mi.load_dict({"type": "scene", "mesh": mesh})
        self.facets = floats(np.array(facets))
        self.corners = floats(vertices)
        self.indices = floats([index for index, _ in self.media])
        self.absorptions = floats([absorption * self.period for _, absorption in self.media])

    def trace(self, direction: Float64, count: int, seed: int) -> Particles:
        """Parallel unpolarised light along `direction` (3,), product's frame, z > 0, evenly over one period."""
        towards = np.asarray(direction, np.float64) / np.linalg.norm(direction)
        random = mi.PCG32(size=count, initstate=seed)
        y, turn = random.next_float32(), random.next_float32() * (2 * np.pi)
        ray = mi.Vector3f(*map(float, towards))
        dr.make_opaque(ray)
        ray = ray + dr.zeros(mi.Vector3f, count)
        one, two = mi.coordinate_system(ray)
        real, imaginary = mi.Vector3f(one * dr.cos(turn) + two * dr.sin(turn)), dr.zeros(mi.Vector3f, count)
        # Particles start on a plane before the product; the beam's own slant only shifts them along the period.
        point = mi.Point3f(0.0, y, self.low - 0.1)
        state = (
            dr.full(mi.Bool, True, count),
            point,
            ray,
            real,
            imaginary,
            dr.full(mi.Float, 1.0, count),
            dr.zeros(mi.UInt32, count),
            random,
        )
        state = dr.while_loop(state, lambda active, *_: active, self._step, label="microgeometry")
        dr.eval(state)
        _, point, ray, _, _, weight, hits, _ = state
        directions, weights = np.stack([np.array(part) for part in ray], axis=1).astype(np.float64), np.array(weight)
        heights, weights = np.array(point.z), weights.astype(np.float64) / count
        sent, back = heights > self.high, heights < self.low
        done = (np.array(hits) < MAX_HITS) & (sent | back)
        sent, back = sent & done, back & done
        unfinished = float(weights[~done].sum())
        reflected = float(weights[back].sum())
        absorbed = 1.0 - float(weights.sum())
        return Particles(directions[sent], weights[sent], reflected, absorbed, unfinished)

    def _step(
        self,
        active: Any,
        point: Any,
        ray: Any,
        real: Any,
        imaginary: Any,
        weight: Any,
        hits: Any,
        random: Any,
    ) -> tuple[Any, ...]:
        """To the next facet and past it or back."""
        found = self.scene.ray_intersect_preliminary(mi.Ray3f(point, ray), active=active)
        hit = active & found.is_valid()
        # What hits nothing leaves: far enough along its way to be before or behind the product.
        leaving = active & ~hit
        far = (4.0 * (self.high - self.low) + 1.0) / dr.maximum(dr.abs(ray.z), 0.02)
        point = dr.select(leaving, point + ray * far, point)
        facet = found.prim_index // 2
        side = [dr.gather(mi.Float, self.facets, facet * 5 + k, hit) for k in range(5)]
        a = dr.gather(mi.Point3f, self.corners, facet * 4, hit)
        b = dr.gather(mi.Point3f, self.corners, facet * 4 + 3, hit)
        # Left of a line along (y, z) is (-dz, dy) to its direction.
        normal = dr.normalize(mi.Vector3f(0.0, -(b.z - a.z), b.y - a.y))
        from_left = dr.dot(ray, normal) < 0.0
        normal = dr.select(from_left, normal, -normal)
        before, after = (mi.UInt32(dr.select(from_left, side[k], side[1 - k])) for k in (0, 1))
        absorption = dr.gather(mi.Float, self.absorptions, before, hit)
        weight = dr.select(hit, weight * dr.exp(-absorption * found.t), weight)
        is_mirror = side[2] > 0.5
        weight = dr.select(hit & is_mirror, weight * dr.select(from_left, side[3], side[4]), weight)

        n1, n2 = (dr.gather(mi.Float, self.indices, medium, hit) for medium in (before, after))
        cosine = -dr.dot(ray, normal)
        across = dr.cross(ray, normal)
        is_upright = dr.squared_norm(across) < 1e-12
        s = dr.select(is_upright, mi.coordinate_system(normal)[0], dr.normalize(across))
        square = 1.0 - dr.square(n1 / n2) * (1.0 - dr.square(cosine))
        is_total = square <= 0.0
        cosine_2 = dr.sqrt(dr.abs(square))
        r_s, r_p = _ratio(n1 * cosine, n2 * cosine_2, is_total), _ratio(n2 * cosine, n1 * cosine_2, is_total)
        turned, bent = ray + 2.0 * cosine * normal, ray * (n1 / n2) + normal * (n1 / n2 * cosine - cosine_2)
        turned, bent = dr.normalize(turned), dr.normalize(bent)

        p = dr.cross(ray, s)
        field_s, field_p = (mi.Complex2f(dr.dot(real, axis), dr.dot(imaginary, axis)) for axis in (s, p))
        back_s, back_p = field_s * r_s, field_p * r_p
        whole = dr.squared_norm(field_s) + dr.squared_norm(field_p)
        chance = (dr.squared_norm(back_s) + dr.squared_norm(back_p)) / whole
        reflects = is_mirror | is_total | (random.next_float32() < chance)
        t_s = 2.0 * n1 * cosine / (n1 * cosine + n2 * cosine_2)
        t_p = 2.0 * n1 * cosine / (n2 * cosine + n1 * cosine_2)
        # An ideal metal turns both fields round.
        back_s, back_p = dr.select(is_mirror, -field_s, back_s), dr.select(is_mirror, field_p, back_p)
        out_s, out_p = dr.select(reflects, back_s, field_s * t_s), dr.select(reflects, back_p, field_p * t_p)
        onward = dr.select(reflects, turned, bent)
        p = dr.cross(onward, s)
        scale = dr.rsqrt(dr.maximum(dr.squared_norm(out_s) + dr.squared_norm(out_p), 1e-20))
        place = point + ray * found.t + normal * dr.select(reflects, STEP, -STEP)
        y = place.y - dr.floor(place.y)
        hits = hits + 1
        return (
            hit & (hits < MAX_HITS) & (weight > 1e-6),
            dr.select(hit, mi.Point3f(0.0, y, place.z), point),
            dr.select(hit, onward, ray),
            dr.select(hit, (out_s.real * s + out_p.real * p) * scale, real),
            dr.select(hit, (out_s.imag * s + out_p.imag * p) * scale, imaginary),
            weight,
            hits,
            random,
        )


def _ratio(one: Any, two: Any, is_total: Any) -> Any:
    """(one - two) / (one + two), or (one - i two) / (one + i two) in total reflection [Born & Wolf, 1.5]."""
    plain = mi.Complex2f((one - two) / (one + two), 0.0)
    scale = 1.0 / (dr.square(one) + dr.square(two))
    total = mi.Complex2f((dr.square(one) - dr.square(two)) * scale, -2.0 * one * two * scale)
    return dr.select(is_total, total, plain)
