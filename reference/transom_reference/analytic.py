"""Answers that need no sampling: form factors, furnace, glass, and radiosity in a rectangular box of six diffuse faces.

The box is solved by collocation: unknown radiosities at the centres of graded cells of each face, with exact
point-to-rectangle form factors, so that only the course of the radiosity within a cell is approximated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from transom.glass import REFRACTIVE_INDEX

Float64 = NDArray[np.float64]

FACES = ("x0", "x1", "y0", "y1", "z0", "z1")
"""Faces of a box: x0 is the face at x = 0, x1 the face at x = size; normals point inwards."""

CUBE_SIZE_M = 10.0
CUBE_INTENSITY_CD = 50_000.0
CUBE_REFLECTANCE = 2.0 / 3.0
CUBE_MEAN_CD_M2 = 2000.0 / 3.0
"""Mean luminance of CUBE, exactly: flux 4 pi I spread over 600 m², reflected without end [Khodulev & Kopylov 1996]."""

CUBE_LUMINANCE_CD_M2 = {
    (0.0, 0.0): 892.8,
    (0.5, 0.0): 768.7,
    (0.5, 0.5): 686.7,
    (1.0, 0.0): 565.4,
    (0.4, 0.0): 806.1,
    (0.4, 0.4): 741.6,
    (0.8, 0.0): 656.9,
    (0.8, 0.4): 619.8,
    (0.8, 0.8): 533.7,
    (0.9, 0.9): 479.0,
}
"""Luminance on a face of CUBE [cd/m²] at face coordinates in [-1, 1]; `refine_cube` gives the same to 0.05 %."""


def furnace_luminance(emitted: float, reflectance: float) -> float:
    """Luminance everywhere in a closed room of uniform own luminance [cd/m²] and reflectance 0..1 (below 1)."""
    return emitted / (1.0 - reflectance)


def clear_slab_transmittance(cos_theta: Float64, index: float = REFRACTIVE_INDEX) -> Float64:
    """Transmittance of a slab that absorbs nothing, unpolarised, all inter-reflections: mean of (1 - r) / (1 + r)."""
    c = np.asarray(cos_theta, dtype=np.float64)
    t = np.sqrt(1.0 - (1.0 - c * c) / index**2)
    r_s = ((c - index * t) / (c + index * t)) ** 2
    r_p = ((index * c - t) / (index * c + t)) ** 2
    return np.asarray(0.5 * ((1 - r_s) / (1 + r_s) + (1 - r_p) / (1 + r_p)))


def _corner_parallel(a: Float64, b: Float64, h: Float64) -> Float64:
    """Solid-angle integral of cos(theta) of a rectangle a x b in a parallel plane at h, point under a corner."""
    p, q = np.sqrt(a * a + h * h), np.sqrt(b * b + h * h)
    return np.asarray(0.5 * (a / p * np.arctan2(b, p) + b / q * np.arctan2(a, q)))


def _corner_perpendicular(a: Float64, z: Float64, d: Float64) -> Float64:
    """The same for an upright rectangle: width a, height z above the point's plane, distance d, opposite a corner."""
    s = np.sqrt(d * d + z * z)
    return np.asarray(0.5 * (np.arctan2(a, d) - d / s * np.arctan2(a, s)))


def parallel_rectangle_factor(x: Float64, y: Float64, h: Float64, rectangle: tuple[Float64, ...]) -> Float64:
    """Form factor from points (x, y) to rectangles (x0, x1, y0, y1) in a parallel plane at distance h > 0; unitless."""
    x0, x1, y0, y1 = rectangle

    def corner(u: Float64, v: Float64) -> Float64:
        return np.asarray(np.sign(u) * np.sign(v) * _corner_parallel(np.abs(u), np.abs(v), h))

    total = corner(x1 - x, y1 - y) - corner(x0 - x, y1 - y) - corner(x1 - x, y0 - y) + corner(x0 - x, y0 - y)
    return np.asarray(total / np.pi)


def perpendicular_rectangle_factor(x: Float64, d: Float64, rectangle: tuple[Float64, ...]) -> Float64:
    """Form factor from points at distance d > 0 of an upright plane to rectangles (x0, x1, z0, z1) in it, z >= 0 above
    the points' plane, x along the plane as the points' x; unitless."""
    x0, x1, z0, z1 = rectangle

    def corner(u: Float64, z: Float64) -> Float64:
        return np.asarray(np.sign(u) * _corner_perpendicular(np.abs(u), z, d))

    total = corner(x1 - x, z1) - corner(x0 - x, z1) - corner(x1 - x, z0) + corner(x0 - x, z0)
    return np.asarray(total / np.pi)


@dataclass(frozen=True)
class BoxSolution:
    """Radiosity in a box. size [m]; edges: cell edges on [0, 1] for both directions of every face.

    reflectance, emitted: by face [-, lm/m²]. radiosity: (6, n, n) at cell centres [lm/m²]; first index along the face's
    first axis. point_intensity_cd: of the isotropic source at the centre.
    """

    size: tuple[float, float, float]
    edges: Float64
    reflectance: Float64
    emitted: Float64
    radiosity: Float64
    point_intensity_cd: float = 0.0

    def luminance(self, face: str, u: float, v: float) -> float:
        """Luminance [cd/m²] at a point of a face; u, v in [0, 1] along its axes in the order x, y, z.

        The illuminance of the point is gathered exactly from the cells: smoother than the cells themselves.
        """
        index = FACES.index(face)
        points = np.array([[u, v]])
        irradiance = _gather(self.size, self.edges, self.radiosity, index, points)[0]
        irradiance += _point_source(self.size, index, points, self.point_intensity_cd)[0]
        return float((self.emitted[index] + self.reflectance[index] * irradiance) / np.pi)

    def mean_luminance(self, face: str) -> float:
        """Area mean over a face [cd/m²]."""
        width = np.diff(self.edges)
        return float((self.radiosity[FACES.index(face)] * np.outer(width, width)).sum() / np.pi)


def graded_edges(count: int) -> Float64:
    """Cell edges on [0, 1], finer towards both ends, where radiosity bends most."""
    t = np.linspace(0.0, 1.0, count + 1)
    return np.asarray(0.5 * (1.0 - np.cos(np.pi * t)) * 0.7 + 0.3 * t)


def solve_box(
    size: tuple[float, float, float],
    reflectance: dict[str, float],
    luminance_cd_m2: dict[str, float],
    cells: int = 32,
    point_intensity_cd: float = 0.0,
) -> BoxSolution:
    """Radiosity of an empty closed box from (0, 0, 0) to `size` [m].

    reflectance, luminance_cd_m2 (own luminance): by face name, 0 where absent. cells: per direction of a face.
    point_intensity_cd: an isotropic source at the centre. Error falls as 1 / cells²: about 0.1 % at 20.
    """
    edges = graded_edges(cells)
    middle = 0.5 * (edges[1:] + edges[:-1])
    points = np.stack(np.meshgrid(middle, middle, indexing="ij"), axis=-1).reshape(-1, 2)
    rho = np.array([reflectance.get(face, 0.0) for face in FACES])
    emitted = np.pi * np.array([luminance_cd_m2.get(face, 0.0) for face in FACES])
    direct = np.stack([_point_source(size, face, points, point_intensity_cd) for face in range(6)])
    source = emitted[:, None] + rho[:, None] * direct
    factors = [_factors(size, edges, face, points) for face in range(6)]
    radiosity = source.copy()
    while True:
        gathered = np.stack([factors[face] @ radiosity.ravel() for face in range(6)])
        following = source + rho[:, None] * gathered
        change = float(np.abs(following - radiosity).max() / max(np.abs(following).max(), 1e-300))
        radiosity = following
        if change < 1e-10:
            break
    return BoxSolution(size, edges, rho, emitted, radiosity.reshape(6, cells, cells), point_intensity_cd)


@dataclass(frozen=True)
class RefinedBox:
    """Two solutions of one box, the finer with twice the cells, extrapolated: (4 fine - coarse) / 3 [Richardson]."""

    coarse: BoxSolution
    fine: BoxSolution

    def luminance(self, face: str, u: float, v: float) -> float:
        """Luminance [cd/m²] at a point of a face; u, v in [0, 1] along its axes in the order x, y, z."""
        return (4 * self.fine.luminance(face, u, v) - self.coarse.luminance(face, u, v)) / 3

    def mean_luminance(self, face: str) -> float:
        """Area mean over a face [cd/m²]."""
        return (4 * self.fine.mean_luminance(face) - self.coarse.mean_luminance(face)) / 3


def refine_box(
    size: tuple[float, float, float],
    reflectance: dict[str, float],
    luminance_cd_m2: dict[str, float],
    cells: int = 12,
    point_intensity_cd: float = 0.0,
) -> RefinedBox:
    """`solve_box` with `cells` and twice as many cells, extrapolated: within 0.02 % away from vertices."""
    coarse = solve_box(size, reflectance, luminance_cd_m2, cells, point_intensity_cd)
    fine = solve_box(size, reflectance, luminance_cd_m2, 2 * cells, point_intensity_cd)
    return RefinedBox(coarse, fine)


def refine_cube(cells: int = 12) -> RefinedBox:
    """CUBE: 10 m, point source of 50,000 cd at the centre, reflectance 2/3."""
    return refine_box((CUBE_SIZE_M,) * 3, dict.fromkeys(FACES, CUBE_REFLECTANCE), {}, cells, CUBE_INTENSITY_CD)


def _axes(face: int) -> tuple[int, int, int]:
    """The axis along the normal, and the two axes in the face, ascending."""
    normal = face // 2
    first, second = (axis for axis in range(3) if axis != normal)
    return normal, first, second


def _point_source(size: tuple[float, float, float], face: int, points: Float64, intensity: float) -> Float64:
    """Illuminance [lx] of points (N, 2) of a face from an isotropic source at the centre."""
    normal, first, second = _axes(face)
    a, b = (points[:, 0] - 0.5) * size[first], (points[:, 1] - 0.5) * size[second]
    h = 0.5 * size[normal]
    return np.asarray(intensity * h / (a * a + b * b + h * h) ** 1.5)


def _gather(
    size: tuple[float, float, float], edges: Float64, radiosity: Float64, face: int, points: Float64
) -> Float64:
    return np.asarray(_factors(size, edges, face, points) @ radiosity.ravel())


def _factors(size: tuple[float, float, float], edges: Float64, face: int, points: Float64) -> Float64:
    """Form factors (N, 6 n n) from points (N, 2) of a face, in [0, 1]², to all cells of all faces."""
    normal, first, second = _axes(face)
    place = {first: points[:, 0] * size[first], second: points[:, 1] * size[second]}
    n = len(edges) - 1
    result = np.zeros((len(points), 6, n, n))
    for other in range(6):
        if other == face:
            continue
        other_normal, other_first, other_second = _axes(other)
        low = {axis: edges[:-1] * size[axis] for axis in (other_first, other_second)}
        high = {axis: edges[1:] * size[axis] for axis in (other_first, other_second)}
        if other_normal == normal:
            x, y = (place[axis][:, None, None] for axis in (first, second))
            rectangle = (low[first][:, None], high[first][:, None], low[second][None, :], high[second][None, :])
            result[:, other] = parallel_rectangle_factor(x, y, np.asarray(size[normal]), rectangle)
            continue
        # The other face stands on this one: `shared` runs along both, `normal` is height above this face.
        shared = first if other_normal == second else second
        d = place[other_normal] if other % 2 == 0 else size[other_normal] - place[other_normal]
        z_low, z_high = low[normal], high[normal]
        if face % 2 == 1:
            z_low, z_high = size[normal] - high[normal], size[normal] - low[normal]
        along_first = other_first == shared
        u_low, u_high = low[shared], high[shared]
        expand = (slice(None), None) if along_first else (None, slice(None))
        across = (None, slice(None)) if along_first else (slice(None), None)
        rectangle = (u_low[expand], u_high[expand], z_low[across], z_high[across])
        x = place[shared][:, None, None]
        result[:, other] = perpendicular_rectangle_factor(x, d[:, None, None], rectangle)
    return result.reshape(len(points), -1)
