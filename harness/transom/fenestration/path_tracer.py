"""A second tracer of sections, to check the engine's: paths in numpy, polarisation as complex amplitudes [Jones].

It shares no code with the engine's tracer and no formula beyond Fresnel's: there light is a Stokes vector and Mueller
matrices act on it; here it is a pair of amplitudes, of a polarisation drawn by chance.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from transom.products.section import Exits, Line, Section, Traced

Float64 = NDArray[np.float64]
Complex128 = NDArray[np.complex128]
Bool = NDArray[np.bool_]

DIVIDES_ABOVE = 0.05
"""Weight from which a path divides; below, it goes one way by chance with all of its weight."""

OFFSET = 0.3719
"""Of a period: by how much lines are moved along y, so that none lies on the border of the period."""

ARC_LINES = 96
MAXIMUM_STEPS = 4000
OLD = 60
DIES = 0.03
"""From step OLD on a path ends with this chance at each step, and counts for more if it does not: Russian roulette."""

BLOCK = 2048
"""Paths whose distances to all lines are held at once."""

CLOSE = 1e-9
"""Of the period: a line nearer than this is the one that the path is on."""


@dataclass
class _Paths:
    """N paths. place (N, 2): y, z. direction, across (N, 3): the s axis is `across`, perpendicular to the direction.
    s, p (N,): amplitudes, |s|² + |p|² = 1. run (N,): length gone since the last line [m]."""

    place: Float64
    direction: Float64
    across: Float64
    s: Complex128
    p: Complex128
    weight: Float64
    run: Float64

    def select(self, which: Bool | NDArray[np.int64]) -> _Paths:
        return _Paths(**{f.name: getattr(self, f.name)[which] for f in dataclasses.fields(self)})

    @staticmethod
    def joined(parts: list[_Paths]) -> _Paths:
        names = [f.name for f in dataclasses.fields(_Paths)]
        return _Paths(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def trace_paths(section: Section, direction: Float64, rays: int, seed: int) -> Traced:
    """Parallel unpolarised light along `direction` (3,) through a section, as Section.trace gives it.

    rays: stratified over the period; the shares are known to about 1 / rays, plus the chance of weak branches.
    """
    return _Tracer(section, np.asarray(direction, np.float64), seed).trace(rays)


class _Tracer:
    def __init__(self, section: Section, direction: Float64, seed: int) -> None:
        self.random = np.random.default_rng(seed)
        self.period = section.period_m
        low, high = section.depth
        margin = 0.05 * max(high - low, self.period)
        self.low, self.high = low - margin, high + margin
        self.index = np.array([medium[0] for medium in section.media])
        self.absorption = np.array([medium[1] for medium in section.media])
        straight = [piece for line in section.lines for piece in _straight(line)]
        self.lines = [piece for line in straight for piece in _copies(line, self.period)]
        self.direction = direction / np.linalg.norm(direction)
        self.exits: list[tuple[Float64, Float64]] = []
        self.absorbed = 0.0

    def trace(self, rays: int) -> Traced:
        paths = self._start(rays)
        for step in range(MAXIMUM_STEPS):
            if not len(paths.weight):
                break
            paths = self._step(paths)
            if step > OLD:
                lives = self.random.random(len(paths.weight)) > DIES
                paths = paths.select(lives)
                paths.weight = paths.weight / (1 - DIES)
        directions = np.concatenate([found for found, _ in self.exits] or [np.zeros((0, 3))])
        flux = np.concatenate([found for _, found in self.exits] or [np.zeros(0)])
        is_sent = directions[:, 2] * self.direction[2] > 0
        sent, back = Exits(directions[is_sent], flux[is_sent]), Exits(directions[~is_sent], flux[~is_sent])
        return Traced(sent, back, self.absorbed, float(paths.weight.sum()) / rays)

    def _start(self, rays: int) -> _Paths:
        self.share = 1.0 / rays
        y = self.period * (np.arange(rays) + self.random.random(rays)) / rays
        z = np.full(rays, self.low if self.direction[2] > 0 else self.high)
        d = np.tile(self.direction, (rays, 1))
        angle = np.repeat(np.pi * self.random.random((rays + 1) // 2), 2)[:rays]
        angle[1::2] += np.pi / 2  # neighbours are polarised across each other: their mean is unpolarised
        across = np.tile(_perpendicular(self.direction[None]), (rays, 1))
        s, p = np.cos(angle) + 0j, np.sin(angle) + 0j
        return _Paths(np.stack([y, z], 1), d, across, s, p, np.ones(rays), np.zeros(rays))

    def _step(self, paths: _Paths) -> _Paths:
        """To the next line, to the border of the period and in again at the other, or out."""
        distance, line = self._nearest(paths)
        y, dy, dz = paths.place[:, 0], paths.direction[:, 1], paths.direction[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            border = np.where(dy > 0, (self.period - y) / dy, np.where(dy < 0, -y / dy, np.inf))
            plane = (np.where(dz > 0, self.high, self.low) - paths.place[:, 1]) / dz
        plane[dz == 0] = np.inf
        meets = (distance <= border) & (distance <= plane)
        leaves = ~meets & (plane <= border)
        self.exits.append((paths.direction[leaves], paths.weight[leaves] * self.share))
        wraps = ~meets & ~leaves
        over = paths.select(wraps)
        over.place = over.place + border[wraps, None] * over.direction[:, 1:]
        over.place[:, 0] = np.where(over.direction[:, 1] > 0, 0.0, self.period)
        over.run = over.run + border[wraps]
        parts = [over]
        for number in np.unique(line[meets]):
            which = meets & (line == number)
            met = paths.select(which)
            met.place = met.place + distance[which, None] * met.direction[:, 1:]
            met.run = met.run + distance[which]
            parts += self._meet(met, self.lines[number])
        return _Paths.joined(parts)

    def _nearest(self, paths: _Paths) -> tuple[Float64, NDArray[np.int64]]:
        """Distance to the first line on each path's way, infinite without one, and its number."""
        nearest, which = np.full(len(paths.weight), np.inf), np.full(len(paths.weight), -1)
        ends = np.array([(*line.a, *line.b) for line in self.lines])
        ey, ez = ends[:, 2] - ends[:, 0], ends[:, 3] - ends[:, 1]
        for start in range(0, len(nearest), BLOCK):
            part = slice(start, start + BLOCK)
            dy, dz = paths.direction[part, 1:2], paths.direction[part, 2:3]
            ty, tz = ends[:, 0] - paths.place[part, 0:1], ends[:, 1] - paths.place[part, 1:2]
            with np.errstate(divide="ignore", invalid="ignore"):
                denominator = dy * ez - dz * ey
                t, u = (ty * ez - tz * ey) / denominator, (ty * dz - tz * dy) / denominator
            t[~((t > CLOSE * self.period) & (u >= 0) & (u <= 1))] = np.inf
            which[part] = np.argmin(t, axis=1)
            nearest[part] = t[np.arange(len(t)), which[part]]
        return nearest, which

    def _meet(self, paths: _Paths, line: Line) -> list[_Paths]:
        ey, ez = line.b[0] - line.a[0], line.b[1] - line.a[1]
        left = np.array([0.0, -ez, ey]) / np.hypot(ey, ez)  # normal of the left side
        from_left = paths.direction @ left < 0
        here, beyond = np.where(from_left, line.left, line.right), np.where(from_left, line.right, line.left)
        kept = np.exp(-self.absorption[here] * paths.run)
        self._absorb(paths.weight * (1 - kept))
        paths.weight, paths.run = paths.weight * kept, np.zeros(len(kept))
        normal = np.where(from_left[:, None], left, -left)
        cosine = -(paths.direction * normal).sum(1)
        if line.kind == "diffuse":
            reflectance = np.where(from_left, line.reflectance, line.reflectance_right)
            return self._scattered(paths, line, normal, reflectance)
        self._turn(paths, normal)
        mirrored = paths.direction + 2 * cosine[:, None] * normal
        if line.kind == "mirror":
            closed = 1 - line.openness
            r = np.sqrt(closed * np.where(from_left, line.reflectance, line.reflectance_right)) + 0j
            through = np.full(len(r), np.sqrt(line.openness)) + 0j
            return self._divided(paths, (mirrored, r, -r), (paths.direction, through, through))
        n1, n2 = self.index[here], self.index[beyond]
        if line.kind == "gap":
            n2 = np.ones(len(n1))
        rs, rp, inner = _fresnel(n1, n2, cosine)
        if line.kind == "gap":
            passed = paths.direction
            rs, rp = (np.where(np.abs(r) < 1, r * np.sqrt(2 / (1 + np.abs(r) ** 2)), r) for r in (rs, rp))
        else:
            ratio = (n1 / n2)[:, None]
            passed = ratio * paths.direction + (ratio * cosine[:, None] - inner[:, None]) * normal
            passed /= np.linalg.norm(passed, axis=1, keepdims=True)
        ts, tp = (np.sqrt(np.maximum(0.0, 1 - np.abs(r) ** 2)) + 0j for r in (rs, rp))
        return self._divided(paths, (mirrored, rs, rp), (passed, ts, tp))

    def _turn(self, paths: _Paths, normal: Float64) -> None:
        """To the s and p axes of a plane of incidence."""
        axis = np.cross(paths.direction, normal)
        size = np.linalg.norm(axis, axis=1, keepdims=True)
        axis = np.where(size > 1e-12, axis / np.maximum(size, 1e-300), paths.across)
        c = (axis * paths.across).sum(1)
        sine = (axis * np.cross(paths.direction, paths.across)).sum(1)
        paths.s, paths.p = c * paths.s + sine * paths.p, c * paths.p - sine * paths.s
        paths.across = axis

    def _divided(self, paths: _Paths, *ways: tuple[Float64, Complex128, Complex128]) -> list[_Paths]:
        """Each way (directions, amplitude factors of s and p), or one of them by chance; what none takes is lost."""
        shares = [np.abs(s * paths.s) ** 2 + np.abs(p * paths.p) ** 2 for _, s, p in ways]
        total = np.sum(shares, axis=0)
        self._absorb(paths.weight * np.maximum(0.0, 1 - total))
        divides = paths.weight > DIVIDES_ABOVE
        first = self.random.random(len(total)) * total < shares[0]
        parts = []
        for number, ((direction, s, p), share) in enumerate(zip(ways, shares, strict=True)):
            takes = (divides | (first == (number == 0))) & (share > 0)
            part = paths.select(takes)
            size = np.sqrt(share[takes])
            part.s, part.p = part.s * s[takes] / size, part.p * p[takes] / size
            part.direction = direction[takes]
            part.weight = part.weight * np.where(divides[takes], share[takes], total[takes])
            parts.append(part)
        return parts

    def _scattered(self, paths: _Paths, line: Line, normal: Float64, reflectance: Float64) -> list[_Paths]:
        closed = 1 - line.openness
        shares = [
            np.full(len(paths.weight), line.openness),
            closed * reflectance,
            np.full(len(paths.weight), closed * line.transmittance),
        ]
        parts = []
        for number, share in enumerate(shares):
            part = paths.select(share > 0)
            part.weight = part.weight * share[share > 0]
            if number:
                part.direction = self._lambertian(normal[share > 0] * (1.0 if number == 1 else -1.0))
                part.across = _perpendicular(part.direction)
            parts.append(part)
        self._absorb(paths.weight * (1 - np.sum(shares, axis=0)))
        joined = _Paths.joined(parts)
        weak = joined.weight < DIVIDES_ABOVE / 4
        lives = ~weak | (self.random.random(len(weak)) < 0.5)  # Russian roulette
        joined.weight = np.where(weak, 2.0, 1.0) * joined.weight
        return [joined.select(lives)]

    def _lambertian(self, normal: Float64) -> Float64:
        """Cosine-distributed: a point on the unit sphere about the tip of the normal."""
        z, phi = 2 * self.random.random(len(normal)) - 1, 2 * np.pi * self.random.random(len(normal))
        radius = np.sqrt(1 - z * z)
        found = normal + np.stack([radius * np.cos(phi), radius * np.sin(phi), z], axis=1)
        return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))

    def _absorb(self, weight: Float64) -> None:
        self.absorbed += float(weight.sum()) * self.share


def _straight(line: Line) -> Iterator[Line]:
    """An arc as straight lines."""
    for a, b in itertools.pairwise(line.points(ARC_LINES)):
        yield dataclasses.replace(line, a=a, b=b, bow=0.0)


def _copies(line: Line, period: float) -> Iterator[Line]:
    """The line where it and its repetitions lie within 0 <= y <= period."""
    line = _shifted(line, OFFSET * period)
    low, high = sorted((line.a[0], line.b[0]))
    for k in range(int(np.floor(-high / period)), int(np.ceil(1 - low / period)) + 1):
        if low + k * period <= period and high + k * period >= 0:
            yield _shifted(line, k * period)


def _shifted(line: Line, by: float) -> Line:
    a, b = ((y + by, z) for y, z in (line.a, line.b))
    return dataclasses.replace(line, a=a, b=b)


def _perpendicular(directions: Float64) -> Float64:
    axis = np.where(np.abs(directions[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    found = np.cross(directions, axis)
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def _fresnel(n1: Float64, n2: Float64, cosine: Float64) -> tuple[Complex128, Complex128, Float64]:
    """Amplitude coefficients of reflection for s and p, complex in total reflection, and the cosine beyond (0 there)
    [Born & Wolf 1999, section 1.5]."""
    inner = np.sqrt((1 - (n1 / n2) ** 2 * (1 - cosine**2)).astype(np.complex128))
    rs = (n1 * cosine - n2 * inner) / (n1 * cosine + n2 * inner)
    rp = (n2 * cosine - n1 * inner) / (n2 * cosine + n1 * inner)
    return rs.astype(np.complex128), rp.astype(np.complex128), inner.real.astype(np.float64)
