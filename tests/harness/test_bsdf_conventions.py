"""Planted faults of convention: each is caught by where a real prism, different from every side, sends light.

Four switches make sixteen readings of one file: front and back exchanged, rows and columns exchanged, azimuth mirrored,
azimuth turned by 180 degrees. One of them is right, and one is right too: light turned round takes the same way.
"""

from __future__ import annotations

import math
import re
from itertools import product as combinations
from pathlib import Path as FilePath

import numpy as np
import pytest

from transom.bsdf import Bsdf, Path, Spectrum, read_bsdf
from transom.bsdf.bsdf import KlemsMatrix
from transom.bsdf.directions import KLEMS_FULL
from transom.bsdf.window_xml import write_klems_xml
from transom.products import load_product
from transom.products.goniophotometer import directions_in
from transom.products.section import Section

INDEX, FACET_DEG, TURN_DEG = 1.49, 45.0, 35.0
"""The prism: facets of 45 and 70 degrees, turned by 35 degrees about the normal, so that no mirror shows it itself."""

MOVED_BY_A_FAULT = 0.5
MOVED_BY_SAMPLING = 0.3
"""Twelve directions of an incident bin against eight others: lobes are narrower than the bins that they fall in."""

Fault = tuple[int, int, int, int]
RIGHT: tuple[Fault, Fault] = ((0, 0, 0, 0), (1, 1, 0, 1))
"""(exchanged sides, exchanged rows and columns, mirrored, turned). The second is Helmholtz's reciprocity."""


def turn() -> np.ndarray:
    c, s = math.cos(math.radians(TURN_DEG)), math.sin(math.radians(TURN_DEG))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def prism() -> Section:
    changes = {"angle_low": FACET_DEG, "angle_high": 70.0, "absorption": 0.0, "index": INDEX}
    return load_product("prismatic_panel").with_parameters(changes).section()


def sent_to(section: Section, incident: np.ndarray, seed: int) -> np.ndarray:
    """Flux into each bin (145,) of light along `incident` through the turned prism."""
    exits = section.trace(turn().T @ incident, 64, seed).transmitted
    return np.bincount(KLEMS_FULL.bin_of(exits.directions @ turn().T), exits.flux, KLEMS_FULL.count)


@pytest.fixture(scope="module")
def prism_text(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The prism's tables as a file."""
    section, scattering = prism(), {}
    for path, sign in ((Path.transmission_front, 1), (Path.transmission_back, -1)):
        flux = np.zeros((KLEMS_FULL.count, KLEMS_FULL.count))
        for column in range(KLEMS_FULL.count):
            for number, direction in enumerate(directions_in(KLEMS_FULL, column, 8, seed=1)):
                flux[:, column] += sent_to(section, direction * [1, 1, sign], number) / 8
        table = KlemsMatrix(KLEMS_FULL, flux / KLEMS_FULL.projected_solid_angles[:, None])
        scattering[Spectrum.visible, path] = table
    file = tmp_path_factory.mktemp("prism") / "prism.xml"
    write_klems_xml(file, Bsdf("prism", "", "traced", scattering))
    return file.read_text()


@pytest.fixture(scope="module")
def prediction() -> list[tuple[np.ndarray, np.ndarray]]:
    """Light that really goes through: middles of incident bins, and flux by bin of other directions in them than those
    of the file."""
    section = prism()
    columns = np.random.default_rng(8).choice(KLEMS_FULL.count, 60, replace=False)
    return [
        (
            KLEMS_FULL.centres[column],
            np.mean([sent_to(section, d, 100 + n) for n, d in enumerate(directions_in(KLEMS_FULL, column, 12, 2))], 0),
        )
        for column in columns
    ]


def moved(read: Bsdf, prediction: list[tuple[np.ndarray, np.ndarray]]) -> float:
    """Share of the predicted flux that the file sends elsewhere."""
    table = read.get(Path.transmission_front).klems(KLEMS_FULL)
    said = [KLEMS_FULL.projected_solid_angles * table[:, KLEMS_FULL.bin_of(direction)] for direction, _ in prediction]
    differences = sum(np.abs(a - b).sum() for a, (_, b) in zip(said, prediction, strict=True))
    return float(differences / 2 / sum(b.sum() for _, b in prediction))


def planted(text: str, fault: Fault) -> str:
    """The file as somebody with these faults of convention would write it."""
    exchanged, transposed, mirrored, turned = fault
    if exchanged:
        text = text.replace("Transmission Front", "@").replace("Transmission Back", "Transmission Front")
        text = text.replace("@", "Transmission Back")
    if transposed:
        text = text.replace(">Columns<", ">Rows<")
    order = np.arange(KLEMS_FULL.count)
    if mirrored:
        order = order[KLEMS_FULL.bin_of(KLEMS_FULL.centres * [1.0, -1.0, 1.0])]
    if turned:
        order = order[KLEMS_FULL.opposite]

    def reordered(found: re.Match[str]) -> str:
        values = np.array(found[1].replace(",", " ").split(), float).reshape(KLEMS_FULL.count, -1)
        rows = [" ".join(f"{value:.7e}" for value in row) for row in values[np.ix_(order, order)]]
        return "<ScatteringData>" + "\n".join(rows) + "</ScatteringData>"

    return re.sub(r"<ScatteringData>(.*?)</ScatteringData>", reordered, text, flags=re.DOTALL)


@pytest.mark.parametrize("fault", list(combinations((0, 1), repeat=4)))
def test_the_prism_catches_every_fault_of_convention(
    fault: Fault, prism_text: str, prediction: list[tuple[np.ndarray, np.ndarray]], tmp_path: FilePath
) -> None:
    file = tmp_path / "planted.xml"
    file.write_text(planted(prism_text, fault))
    share = moved(read_bsdf(file), prediction)
    if fault in RIGHT:
        assert share < MOVED_BY_SAMPLING
    else:
        assert share > MOVED_BY_A_FAULT


def test_the_prediction_is_snells() -> None:
    """Light that meets the flat face and then one facet leaves where Snell's law says, by formulas of its own."""
    section = prism()
    slope = math.radians(FACET_DEG)
    normal = turn() @ np.array([0.0, -math.sin(slope), math.cos(slope)])  # the facet rises with y: it leans to -y
    found = 0
    for incident in KLEMS_FULL.centres:
        inside = refracted(incident, np.array([0.0, 0.0, 1.0]), 1.0, INDEX)
        assert inside is not None
        outside = refracted(inside, normal, INDEX, 1.0)
        if outside is None or outside[2] < 0.2 or inside @ normal < 0.3:
            continue
        exits = section.trace(turn().T @ incident, 64).transmitted
        strongest = int(np.argmax(exits.flux))
        if exits.flux[strongest] > 0.5 * exits.total:
            np.testing.assert_allclose(turn() @ exits.directions[strongest], outside, atol=1e-9)
            found += 1
    assert found >= 5


def refracted(direction: np.ndarray, normal: np.ndarray, n1: float, n2: float) -> np.ndarray | None:
    """Snell's law for light that crosses a face along its normal's way; None when it is totally reflected."""
    tangential = (n1 / n2) * (direction - (direction @ normal) * normal)
    rest = 1 - tangential @ tangential
    return None if rest <= 0 else tangential + math.sqrt(rest) * normal


def test_a_scan_of_the_prism_goes_where_the_prism_sends_it(tmp_path: FilePath) -> None:
    """pab-opto: both angles are of directions away from the sample, phi 90 is up, theta 0 looks into the room."""
    section = prism()
    incident = np.array([-0.6, 0.3, math.sqrt(1 - 0.6**2 - 0.3**2)])
    exits = section.trace(turn().T @ incident, 64).transmitted
    strongest = turn() @ exits.directions[int(np.argmax(exits.flux))]
    assert np.abs(strongest[:2]).min() > 0.2  # no mirror image is near

    def angles(direction: np.ndarray) -> tuple[float, float]:
        return math.degrees(math.acos(direction[2])), math.degrees(math.atan2(direction[1], direction[0])) % 360

    theta, phi = angles(-incident)
    lines = [f"#format: theta phi DSF\n#intheta {theta}\n#inphi {phi}\n#upphi 90"]
    for out_theta in range(1, 89, 4):
        for out_phi in range(0, 360, 6):
            t, p = math.radians(out_theta), math.radians(out_phi)
            direction = np.array([math.sin(t) * math.cos(p), math.sin(t) * math.sin(p), math.cos(t)])
            lines.append(f"{out_theta} {out_phi} {math.exp(-((1 - direction @ strongest) / 0.005)):.6f}")
    file = tmp_path / "scan.txt"
    file.write_text("\n".join(lines))
    table = read_bsdf(file).get(Path.transmission_front)
    towards = np.stack([strongest, strongest * [1, -1, 1], strongest * [-1, 1, 1], strongest * [-1, -1, 1]])
    values = table.evaluate(np.broadcast_to(incident, towards.shape), towards)
    assert values[0] > 10 * values[1:].max()
