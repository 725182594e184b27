"""Scenes whose answer is known: luminances of empty boxes by the engine, beside closed forms and collocation.

Luminances are sampled as illuminance at points 1 mm inside the box, L = L_own + rho E / pi. Means over a face are
Gauss-Legendre sums over 12 x 12 of its points.
"""

from __future__ import annotations

import dataclasses
import importlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from transom.bundle import make_case
from transom.colour import luminance
from transom.comparison import AnalyticComparison
from transom.errors import InputError
from transom.renderer import Renderer
from transom.run import Question, render_case
from transom.scene.model import Scene
from transom.sensor_file import SensorTable
from transom.suite import SuiteCase

Float64 = NDArray[np.float64]

FACES = ("x0", "x1", "y0", "y1", "z0", "z1")
"""Faces of a box by axis and side, as in transom_reference.analytic."""

INSET_M = 0.001
"""How far inside the box its faces are sampled."""

MEAN_POINTS = 12
"""Gauss-Legendre points a direction for the mean over a face."""

FURNACE_REFLECTANCES = (0.5, 0.8, 0.9)

CUBE_UNCERTAINTY, BOX_UNCERTAINTY = 5e-4, 2e-4
"""Relative standard uncertainties of the published CUBE values (by an independent solution) and of refined boxes."""

FACE_SPOTS = ((0.5, 0.5), (0.25, 0.5), (0.25, 0.25))
"""Where on each face of three_tone luminances are compared, as shares of its two sides."""


@dataclass(frozen=True)
class Box:
    """An empty axis-aligned box: its corners [m], and by face the (grey) reflectance and own luminance [cd/m²]."""

    low: Float64
    high: Float64
    reflectance: dict[str, float]
    luminance: dict[str, float]

    def points(self, face: str, places: Sequence[tuple[float, float]]) -> tuple[Float64, Float64]:
        """Points (N, 3) just inside a face at shares (u, v) of its sides along x, y, z; inward normals (N, 3)."""
        axis, side = "xyz".index(face[0]), int(face[1])
        first, second = (other for other in range(3) if other != axis)
        points, normals = np.empty((len(places), 3)), np.zeros((len(places), 3))
        size = self.high - self.low
        for row, (u, v) in enumerate(places):
            points[row, first] = self.low[first] + u * size[first]
            points[row, second] = self.low[second] + v * size[second]
        points[:, axis] = self.high[axis] - INSET_M if side else self.low[axis] + INSET_M
        normals[:, axis] = -1.0 if side else 1.0
        return points, normals


def compare_known_answer(entry: SuiteCase, renderer: Renderer) -> list[AnalyticComparison]:
    """Every known quantity of a scene. Raises InputError for a scene without a known answer."""
    if entry.scene.name not in _ANSWERS:
        remedy = f"Known answers: {', '.join(_ANSWERS)}"
        raise InputError("has no known answer", file=entry.scene.file, remedy=remedy)
    return _ANSWERS[entry.scene.name](entry, renderer)


def box_of(scene: Scene) -> Box:
    """The scene as an empty box. Raises InputError when a face is off its six sides, or a side has two materials."""
    mesh = scene.mesh
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    materials: dict[str, int] = {}
    for face, material in zip(mesh.faces, mesh.face_material, strict=True):
        corners = mesh.vertices[face[face >= 0]]
        side = next((name for name in FACES if _lies_in(corners, name, low, high)), None)
        if side is None or materials.setdefault(side, int(material)) != int(material):
            raise InputError("is not an empty box with one material a side", file=scene.file)
    found = {side: scene.materials[index] for side, index in materials.items()}
    return Box(
        low,
        high,
        {side: float(luminance(material.reflectance)) for side, material in found.items()},
        {side: float(luminance(material.luminance)) for side, material in found.items()},
    )


def _cube(entry: SuiteCase, renderer: Renderer) -> list[AnalyticComparison]:
    """Khodulev and Kopylov's CUBE: luminances on the floor, in face coordinates from -1 to 1, and its mean."""
    analytic = _analytic()
    known = {place: value for place, value in analytic.CUBE_LUMINANCE_CD_M2.items() if max(place) < 1}
    places = [((u + 1) / 2, (v + 1) / 2) for u, v in known]
    values, mean = _face_luminances(entry, renderer, "z0", places)
    source = "Khodulev and Kopylov 1996; collocation with exact form factors"
    rows = [
        _row(entry, f"L at ({u:g}, {v:g})", ours, truth, CUBE_UNCERTAINTY, source)
        for (u, v), truth, ours in zip(known, known.values(), values, strict=True)
    ]
    exact = "exact: flux over area, reflected without end"
    return [*rows, _row(entry, "mean L of a face", mean, analytic.CUBE_MEAN_CD_M2, 0.0, exact)]


def _furnace(entry: SuiteCase, renderer: Renderer) -> list[AnalyticComparison]:
    """A closed room of one own luminance and one reflectance: L0 / (1 - rho) everywhere."""
    rows = []
    for rho in FURNACE_REFLECTANCES:
        grey = (rho, rho, rho)
        materials = tuple(dataclasses.replace(material, reflectance=grey) for material in entry.scene.materials)
        changed = dataclasses.replace(entry, scene=dataclasses.replace(entry.scene, materials=materials))
        own = box_of(changed.scene).luminance["z0"]
        truth = _analytic().furnace_luminance(own, rho)
        values = [value for face in FACES for value in _face_luminances(changed, renderer, face, FACE_SPOTS)[0]]
        farthest = max(values, key=lambda value: abs(value - truth))
        rows.append(
            _row(entry, f"L, rho = {rho:g}, farthest of {len(values)} points", farthest, truth, 0.0, "L0 / (1 - rho)")
        )
    return rows


def _three_tone(entry: SuiteCase, renderer: Renderer) -> list[AnalyticComparison]:
    """A box of unequal reflectances against collocation: shows where rho stands in the operator."""
    box = box_of(entry.scene)
    size = tuple(float(length) for length in box.high - box.low)
    solution = _analytic().refine_box(size, box.reflectance, box.luminance)
    rows = []
    for face in FACES:
        if box.reflectance[face] == 0:
            continue
        values, mean = _face_luminances(entry, renderer, face, FACE_SPOTS)
        truths = [solution.luminance(face, u, v) for u, v in FACE_SPOTS]
        source = "collocation with exact form factors, extrapolated"
        for (u, v), ours, truth in zip(FACE_SPOTS, values, truths, strict=True):
            rows.append(_row(entry, f"L, face {face} at ({u:g}, {v:g})", ours, truth, BOX_UNCERTAINTY, source))
        rows.append(_row(entry, f"mean L, face {face}", mean, solution.mean_luminance(face), BOX_UNCERTAINTY, source))
    return rows


_ANSWERS = {"cube": _cube, "furnace": _furnace, "three_tone": _three_tone}


def _face_luminances(
    entry: SuiteCase, renderer: Renderer, face: str, places: Sequence[tuple[float, float]]
) -> tuple[list[float], float]:
    """The engine's luminances [cd/m²] at places of a face, and the mean over the face."""
    box = box_of(entry.scene)
    nodes, weights = np.polynomial.legendre.leggauss(MEAN_POINTS)
    shares = (nodes + 1) / 2
    grid = [(float(u), float(v)) for u in shares for v in shares]
    points, normals = box.points(face, [*places, *grid])
    table = SensorTable(("",) * len(points), points, normals)
    case = make_case(entry.scene, entry.condition, renderer, {}, sensors=table)
    measured = render_case(renderer, Question(case)).sensors().illuminance
    if measured is None:
        raise InputError("holds no illuminance", file=entry.scene.file)
    values = box.luminance[face] + box.reflectance[face] * measured / math.pi
    mean = float(np.sum(np.outer(weights, weights).ravel() / 4 * values[len(places) :]))
    return [float(value) for value in values[: len(places)]], mean


def _row(
    entry: SuiteCase, quantity: str, ours: float, truth: float, relative_uncertainty: float, source: str
) -> AnalyticComparison:
    return AnalyticComparison(
        scene=entry.scene.name,
        quantity=quantity,
        unit="cd/m²",
        value=ours,
        truth=truth,
        truth_uncertainty=relative_uncertainty * truth,
        error_percent=100 * (ours / truth - 1),
        source=source,
    )


def _lies_in(corners: Float64, face: str, low: Float64, high: Float64) -> bool:
    axis = "xyz".index(face[0])
    plane = high[axis] if face[1] == "1" else low[axis]
    return bool(np.allclose(corners[:, axis], plane, atol=1e-6))


def _analytic() -> Any:
    """Closed forms belong to the references, which the harness loads by name."""
    return importlib.import_module("transom_reference.analytic")
