"""Closed spaces with interreflection: boxes of scene files, two plates, a room of growing reflectance, a sphere.

Luminances are measured as illuminance at points 1 mm inside, L = L_own + rho E / pi.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from transom.colour import luminance
from transom.daylight.condition import Condition
from transom.errors import InputError
from transom.known.builder import Drawing, dark
from transom.known.case import Answer, KnownCase, sensor_table
from transom.known.truth import analytic
from transom.scene.model import Scene
from transom.suite import SuiteCase

Float64 = NDArray[np.float64]

FACES = ("x0", "x1", "y0", "y1", "z0", "z1")
"""Faces of a box by axis and side, as in transom_reference.analytic."""

INSET_M = 0.001
"""How far inside a box its faces are sampled."""

MEAN_POINTS = 12
"""Gauss-Legendre points a direction for the mean over a face."""

FURNACE_REFLECTANCES = (0.5, 0.8, 0.9)

CUBE_UNCERTAINTY, BOX_UNCERTAINTY = 5e-4, 2e-4
"""Relative standard uncertainties of the published CUBE values (by an independent solution) and of refined boxes."""

FACE_SPOTS = ((0.5, 0.5), (0.25, 0.5), (0.25, 0.25))
"""Where on each face luminances are compared, as shares of its two sides."""

PLATE_SIZE_M, PLATE_LUMINANCE_CD_M2 = (4.0, 4.0, 1.0), 1000.0
PLATE_REFLECTANCE = {"z0": 0.3, "z1": 0.8}

ROOM_M, ROOM_FLUX_LM = 4.0, 10_000.0
ROOM_REFLECTANCES = (0.0, 0.2, 0.5, 0.8)

SPHERE_RADIUS_M, SPHERE_LEVEL, SPHERE_REFLECTANCE = 2.0, 2, 0.5
SPHERE_LAMP_M, SPHERE_LAMP_CD = (0.6, 0.0, 0.0), 1000.0
SPHERE_DECIMALS = 12
"""Of its places: linear algebra differs between processors in the last bits, and stored answers must be found again."""


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

    def spot(self, face: str, row: int, quantity: str, truth: float, uncertainty: float, source: str) -> Answer:
        """The luminance of a face at one sensor [cd/m²]."""
        share = np.array([self.reflectance[face] / math.pi])
        return Answer(
            quantity, "cd/m²", truth, uncertainty * truth, source, np.array([row]), share, self.luminance[face]
        )

    def mean(self, face: str, first_row: int, quantity: str, truth: float, uncertainty: float, source: str) -> Answer:
        """The mean luminance of a face from the sensors of `mean_places`, which begin at a row [cd/m²]."""
        _, weights = mean_places()
        weights = weights * self.reflectance[face] / math.pi
        rows = first_row + np.arange(len(weights))
        return Answer(quantity, "cd/m²", truth, uncertainty * truth, source, rows, weights, self.luminance[face])


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


def mean_places() -> tuple[list[tuple[float, float]], Float64]:
    """Gauss-Legendre places of a face as shares (u, v), and their weights, which sum to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(MEAN_POINTS)
    shares = (nodes + 1) / 2
    return [(float(u), float(v)) for u in shares for v in shares], np.outer(weights, weights).ravel() / 4


def cube(entry: SuiteCase) -> list[KnownCase]:
    """Khodulev and Kopylov's CUBE: luminances on the floor, in face coordinates from -1 to 1, and its mean."""
    box, forms = box_of(entry.scene), analytic("analytic")
    known = {place: value for place, value in forms.CUBE_LUMINANCE_CD_M2.items() if max(place) < 1}
    places = [((u + 1) / 2, (v + 1) / 2) for u, v in known]
    points, normals = box.points("z0", [*places, *mean_places()[0]])

    def answers() -> list[Answer]:
        source = "Khodulev and Kopylov 1996; collocation with exact form factors"
        rows = [
            box.spot("z0", row, f"L at ({u:g}, {v:g})", value, CUBE_UNCERTAINTY, source)
            for row, ((u, v), value) in enumerate(known.items())
        ]
        exact = "exact: flux over area, reflected without end"
        return [*rows, box.mean("z0", len(places), "mean L of a face", forms.CUBE_MEAN_CD_M2, 0.0, exact)]

    return [KnownCase(entry.scene, entry.condition, sensor_table(points, normals), answers)]


def furnace(entry: SuiteCase) -> list[KnownCase]:
    """A closed room of one own luminance and one reflectance: L0 / (1 - rho) everywhere."""
    cases = []
    for rho in FURNACE_REFLECTANCES:
        materials = tuple(dataclasses.replace(entry_, reflectance=(rho,) * 3) for entry_ in entry.scene.materials)
        scene = dataclasses.replace(entry.scene, materials=materials)
        box = box_of(scene)
        places = [box.points(face, FACE_SPOTS) for face in FACES]
        points, normals = (np.concatenate(parts) for parts in zip(*places, strict=True))
        answers = partial(_furnace_answers, box, rho)
        cases.append(KnownCase(scene, entry.condition, sensor_table(points, normals), answers, f"rho {rho:g}"))
    return cases


def _furnace_answers(box: Box, rho: float) -> list[Answer]:
    truth = analytic("analytic").furnace_luminance(box.luminance["z0"], rho)
    faces = [face for face in FACES for _ in FACE_SPOTS]
    return [
        dataclasses.replace(
            box.spot(face, row, f"L, rho = {rho:g}, point {row + 1}", truth, 0.0, "L0 / (1 - rho)"),
            group=f"L, rho = {rho:g}",
        )
        for row, face in enumerate(faces)
    ]


def three_tone(entry: SuiteCase) -> list[KnownCase]:
    """A box of unequal reflectances against collocation: shows where rho stands in the operator."""
    return [_refined_case(entry.scene, entry.condition)]


def two_plates() -> list[KnownCase]:
    """Two parallel plates in black surroundings, one of which glows: exchange of two surfaces to and fro."""
    drawing = Drawing("two_plates", "Two parallel plates")
    drawing.material("glowing", PLATE_REFLECTANCE["z0"], PLATE_LUMINANCE_CD_M2)
    drawing.material("facing", PLATE_REFLECTANCE["z1"])
    drawing.room((0, 0, 0), PLATE_SIZE_M, materials={"z0": "glowing", "z1": "facing"})
    return [_refined_case(drawing.scene(), dark())]


def _refined_case(scene: Scene, condition: Condition) -> KnownCase:
    """An empty box: spots and means of all faces that reflect, against collocation."""

    box = box_of(scene)
    faces = [face for face in FACES if box.reflectance[face] > 0]
    grid, _ = mean_places()
    places = [box.points(face, [*FACE_SPOTS, *grid]) for face in faces]
    points, normals = (np.concatenate(parts) for parts in zip(*places, strict=True))

    def answers() -> list[Answer]:
        width, depth, height = (float(length) for length in box.high - box.low)
        solution = analytic("analytic").refine_box((width, depth, height), box.reflectance, box.luminance)
        source, rows = "collocation with exact form factors, extrapolated", []
        for index, face in enumerate(faces):
            first = index * (len(FACE_SPOTS) + len(grid))
            for number, (u, v) in enumerate(FACE_SPOTS):
                truth = solution.luminance(face, u, v)
                name = f"L, face {face} at ({u:g}, {v:g})"
                rows.append(box.spot(face, first + number, name, truth, BOX_UNCERTAINTY, source))
            truth = solution.mean_luminance(face)
            rows.append(box.mean(face, first + len(FACE_SPOTS), f"mean L, face {face}", truth, BOX_UNCERTAINTY, source))
        return rows

    return KnownCase(scene, condition, sensor_table(points, normals), answers)


def internal_reflection() -> list[KnownCase]:
    """A cubic room around a lamp of 10,000 lm, of growing reflectance: mean E = Phi / (S (1 - rho)).

    By symmetry a quarter of one side stands for all six.
    """
    cases = []
    for rho in ROOM_REFLECTANCES:
        drawing = Drawing("internal_reflection", "Internally reflected component over reflectance")
        drawing.material("grey", rho)
        drawing.lamp((ROOM_M / 2,) * 3, ROOM_FLUX_LM / (4 * math.pi))
        drawing.room((0, 0, 0), (ROOM_M,) * 3, materials=dict.fromkeys(FACES, "grey"))
        places, weights = mean_places()
        quarter = ROOM_M / 2 * np.array(places)
        points = np.column_stack([quarter, np.full(len(quarter), INSET_M)])
        condition = dataclasses.replace(dark(), name=f"rho_{rho:g}")
        answers = partial(_room_answers, rho, weights)
        cases.append(
            KnownCase(
                drawing.scene(), condition, sensor_table(points, np.array([0.0, 0.0, 1.0])), answers, f"rho {rho:g}"
            )
        )
    return cases


def _room_answers(rho: float, weights: Float64) -> list[Answer]:
    truth = ROOM_FLUX_LM / (6 * ROOM_M**2 * (1 - rho))
    rows = np.arange(len(weights))
    source = "Phi / (S (1 - rho)); 144 Gauss points, 0.02 %"
    return [Answer(f"mean E, rho = {rho:g}", "lx", truth, 2e-4 * truth, source, rows, weights)]


def sphere() -> list[KnownCase]:
    """A sphere of 320 triangles around a lamp off its centre: reflected light is the same everywhere,
    Phi rho / (S (1 - rho)), in the mean exactly and at points but for what flat triangles deviate."""
    forms = analytic("analytic_sphere")
    shape = forms.icosphere(SPHERE_RADIUS_M, SPHERE_LEVEL)
    drawing = Drawing("sphere", "Sphere of triangles around a lamp")
    drawing.material("grey", SPHERE_REFLECTANCE)
    drawing.lamp(SPHERE_LAMP_M, SPHERE_LAMP_CD)
    for corners in shape.corners():
        drawing.polygon("grey", np.round(corners, SPHERE_DECIMALS).tolist())
    normals = np.round(shape.normals(), SPHERE_DECIMALS)
    points = np.round(shape.centroids() + INSET_M * normals, SPHERE_DECIMALS)
    return [KnownCase(drawing.scene(), dark(), sensor_table(points, normals), _sphere_answers)]


def _sphere_answers() -> list[Answer]:
    forms = analytic("analytic_sphere")
    shape = forms.icosphere(SPHERE_RADIUS_M, SPHERE_LEVEL)
    normals, areas = shape.normals(), shape.areas()
    points, lamp = shape.centroids() + INSET_M * normals, np.array(SPHERE_LAMP_M)
    direct = forms.lamp_illuminance(points, normals, lamp, SPHERE_LAMP_CD)
    law = 4 * math.pi * SPHERE_LAMP_CD * SPHERE_REFLECTANCE / (areas.sum() * (1 - SPHERE_REFLECTANCE))
    exact = forms.reflected_illuminance(shape, points, normals, lamp, SPHERE_LAMP_CD, SPHERE_REFLECTANCE)
    shares = areas / areas.sum()
    rows = np.arange(len(areas))
    # At centroids the mean misses what varies within a triangle: as much as collocation misses of the law.
    missed = abs(float(shares @ exact) - law)
    deviation = float(np.abs(exact / law - 1).max())
    answers = [
        Answer(
            "mean reflected E",
            "lx",
            law,
            max(missed, 1e-6 * law),
            "Phi rho / (S (1 - rho)), S of the polyhedron",
            rows,
            shares,
            -float(shares @ direct),
        )
    ]
    source = f"collocation on the polyhedron, which deviates from the law by up to {100 * deviation:.2f} %"
    answers += [
        Answer(
            f"reflected E, triangle {row + 1}",
            "lx",
            float(exact[row]),
            5e-4 * float(exact[row]),
            source,
            np.array([row]),
            np.ones(1),
            -float(direct[row]),
            "reflected E",
        )
        for row in rows
    ]
    return answers


OF_SCENES: dict[str, Callable[[SuiteCase], list[KnownCase]]] = {
    "cube": cube,
    "furnace": furnace,
    "three_tone": three_tone,
}
"""Scenes in files whose answer is known."""


def _lies_in(corners: Float64, face: str, low: Float64, high: Float64) -> bool:
    axis = "xyz".index(face[0])
    plane = high[axis] if face[1] == "1" else low[axis]
    return bool(np.allclose(corners[:, axis], plane, atol=1e-6))
