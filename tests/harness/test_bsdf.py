"""Product files: read as Radiance reads them, whatever is wrong is named, and conventions cannot be swapped unseen."""

import math
import os
from itertools import product as combinations
from pathlib import Path as FilePath

import numpy as np
import pyradiance.bsdf as radiance_bsdf
import pytest
from scipy.optimize import linear_sum_assignment

from transom.bsdf import Bsdf, Path, Spectrum, read_bsdf
from transom.bsdf.bsdf import KlemsMatrix
from transom.bsdf.checks import check_bsdf
from transom.bsdf.directions import KLEMS_FULL, disc_from_square, square_from_disc
from transom.bsdf.tensor_tree import TreeError, parse_tree
from transom.bsdf.window_xml import write_klems_xml
from transom.cli import WRONG_USE, run_command
from transom.errors import InputError

RADIANCE_JITTER = 1e-3
"""Radiance changes each value by up to 6e-4 of it, on purpose, to break ties."""


KEPT_HANDLES: list[object] = []
"""Radiance's library frees a table that is still in use when a handle goes: none goes before the tests end."""


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def random_directions(count: int, sign: int, seed: int) -> np.ndarray:
    found = unit(np.random.default_rng(seed).normal(size=(count, 3)))
    return found * np.array([1.0, 1.0, 0.0]) + np.array([0.0, 0.0, sign]) * np.abs(found)


def prism(transmittance: float = 0.8) -> Bsdf:
    """A product that bends light up and to the right, differently from the two sides of its normal: no flip hides."""
    basis = KLEMS_FULL
    towards = basis.centres + np.array([0.15, 0.35, 0.0]) + 0.2 * basis.centres[:, [1]] * np.array([0.0, 1.0, 0.0])
    towards[:, 2] = np.maximum(towards[:, 2], 0.1)
    # Every bin sends its light to a bin of its own: the nearest left, as much as the smaller of the two can hold.
    distance = np.linalg.norm(unit(towards)[None] - basis.centres[:, None], axis=2)
    leaving, arriving = linear_sum_assignment(distance)
    solid = basis.projected_solid_angles
    matrix = np.full((basis.count, basis.count), 0.02 / math.pi)
    matrix[leaving, arriving] += transmittance / np.maximum(solid[leaving], solid[arriving])
    back = matrix[np.ix_(basis.opposite, basis.opposite)].T.copy()
    tables = {Path.transmission_front: matrix, Path.transmission_back: back}
    return Bsdf("prism", "", "test", {(Spectrum.visible, path): KlemsMatrix(basis, m) for path, m in tables.items()})


@pytest.fixture
def prism_file(tmp_path: FilePath) -> FilePath:
    file = tmp_path / "prism.xml"
    write_klems_xml(file, prism())
    return file


def radiance_values(file: FilePath, incident: np.ndarray, leaving: np.ndarray) -> np.ndarray:
    """The BSDF by Radiance's own library, asked with directions that point away from the sample [1/sr]."""
    handle = radiance_bsdf.load_file(str(file))
    KEPT_HANDLES.append(handle)
    values = []
    for source, exit_direction in zip(-incident, leaving, strict=True):
        angles = [
            angle
            for v in (source, exit_direction)
            for angle in (math.degrees(math.acos(max(-1, min(1, v[2])))), math.degrees(math.atan2(v[1], v[0])))
        ]
        answer = np.asarray(radiance_bsdf.query(handle, *angles))
        values.append(answer[1] if answer.size == 3 else answer[0])
    return np.array(values)


def test_klems_bins_fill_the_hemisphere_and_hold_their_own_centres() -> None:
    assert KLEMS_FULL.count == 145
    assert KLEMS_FULL.projected_solid_angles.sum() == pytest.approx(math.pi, rel=1e-12)
    np.testing.assert_array_equal(KLEMS_FULL.bin_of(KLEMS_FULL.centres), np.arange(145))
    np.testing.assert_array_equal(KLEMS_FULL.opposite[KLEMS_FULL.opposite], np.arange(145))


def test_the_square_maps_to_the_disc_and_back_keeping_area() -> None:
    u, v = np.random.default_rng(3).random((2, 20000))
    disc = disc_from_square(u, v)
    np.testing.assert_allclose(square_from_disc(disc[:, 0], disc[:, 1]), np.stack([u, v], -1), atol=1e-9)
    inside = np.mean(np.hypot(disc[:, 0], disc[:, 1]) < 0.5)
    assert inside == pytest.approx(0.25, abs=0.01)
    quadrant = np.mean((disc[:, 0] > 0) & (disc[:, 1] > 0))
    assert quadrant == pytest.approx(0.25, abs=0.01)


def test_a_written_file_reads_back_to_the_same_values(prism_file: FilePath) -> None:
    again = read_bsdf(prism_file)
    for key, table in prism().scattering.items():
        np.testing.assert_allclose(again.scattering[key].klems(KLEMS_FULL), table.klems(KLEMS_FULL), rtol=1e-6)
    assert again.name == "prism"


@pytest.mark.parametrize("path", [Path.transmission_front, Path.transmission_back])
def test_radiance_reads_our_file_as_we_do(prism_file: FilePath, path: Path) -> None:
    incident = random_directions(400, path.incident_sign, 5)
    # Half of the directions where light really goes, so that the peaks are compared too.
    leaving = random_directions(400, path.exit_sign, 6)
    table = prism().get(path)
    bins = np.argmax(table.klems(KLEMS_FULL)[:, KLEMS_FULL.bin_of(incident[:200])], axis=0)
    leaving[:200] = KLEMS_FULL.centres[bins] * np.array([1.0, 1.0, path.exit_sign])
    ours = read_bsdf(prism_file).get(path).evaluate(incident, leaving)
    assert ours[:200].min() > 1  # peaks
    np.testing.assert_allclose(radiance_values(prism_file, incident, leaving), ours, rtol=RADIANCE_JITTER)


def test_every_swapped_convention_moves_most_of_the_prisms_flux() -> None:
    """All 16 flips of x and y on either side, and the transpose: none but the identity may pass for the product."""
    table = prism().get(Path.transmission_front).klems(KLEMS_FULL)
    weight = np.outer(KLEMS_FULL.projected_solid_angles, KLEMS_FULL.projected_solid_angles)

    def moved(other: np.ndarray) -> float:
        return float((weight * np.abs(table - other)).sum() / (2 * (weight * table).sum()))

    flips = [KLEMS_FULL.bin_of(KLEMS_FULL.centres * np.array([sx, sy, 1.0])) for sx in (1, -1) for sy in (1, -1)]
    shares = [moved(table[np.ix_(out, into)]) for out, into in combinations(flips, flips)]
    assert shares[0] == 0
    assert min(shares[1:]) > 0.5
    assert moved(table.T) > 0.5


def test_a_missing_transmission_is_the_other_one_turned_round() -> None:
    full = prism()
    half = Bsdf("half", "", "test", {(Spectrum.visible, Path.transmission_back): full.get(Path.transmission_back)})
    incident, leaving = random_directions(200, 1, 7), random_directions(200, 1, 8)
    np.testing.assert_allclose(
        half.get(Path.transmission_front).evaluate(incident, leaving),
        full.get(Path.transmission_front).evaluate(incident, leaving),
        rtol=1e-9,
    )
    with pytest.raises(InputError, match="Reflection Front"):
        half.get(Path.reflection_front)


def test_rows_are_the_transpose_of_columns(prism_file: FilePath, tmp_path: FilePath) -> None:
    text = prism_file.read_text().replace(">Columns<", ">Rows<").replace("Visible", "viSIBle")
    rows = tmp_path / "rows.xml"
    rows.write_text(text)
    np.testing.assert_allclose(
        read_bsdf(rows).get(Path.transmission_front).klems(KLEMS_FULL),
        prism().get(Path.transmission_front).klems(KLEMS_FULL).T,
        rtol=1e-6,
    )


def tree_file(tmp_path: FilePath, rank: int, data: str) -> FilePath:
    file = tmp_path / f"tree{rank}.xml"
    file.write_text(
        '<?xml version="1.0"?><WindowElement xmlns="http://windows.lbl.gov"><WindowElementType>System</WindowElementType>'
        "<FileType>BSDF</FileType><Optical><Layer><Material><Name>tree</Name></Material><DataDefinition>"
        f"<IncidentDataStructure>TensorTree{rank}</IncidentDataStructure></DataDefinition><WavelengthData>"
        '<LayerNumber>System</LayerNumber><Wavelength unit="Integral">Visible</Wavelength><WavelengthDataBlock>'
        "<WavelengthDataDirection>Transmission Back</WavelengthDataDirection><AngleBasis>LBNL/Shirley-Chiu</AngleBasis>"
        f"<ScatteringDataType>BTDF</ScatteringDataType><ScatteringData>{data}</ScatteringData></WavelengthDataBlock>"
        "</WavelengthData></Layer></Optical></WindowElement>"
    )
    return file


@pytest.mark.parametrize("rank", [3, 4])
def test_radiance_reads_trees_as_we_do(tmp_path: FilePath, rank: int) -> None:
    rng = np.random.default_rng(rank)

    def grid(level: int) -> str:
        return "{ " + " ".join(f"{v:.6f}" for v in 0.3 * rng.random(1 << (rank * level))) + " }"

    # Leaves of one value beside grids of 2 and 4 a side.
    file = tree_file(tmp_path, rank, "{ " + " ".join(grid(child % 3) for child in range(1 << rank)) + " }")
    path = Path.transmission_back
    incident, leaving = random_directions(300, path.incident_sign, 11), random_directions(300, path.exit_sign, 12)
    ours = read_bsdf(file).get(path).evaluate(incident, leaving)
    assert np.ptp(ours) > 0.2
    np.testing.assert_allclose(radiance_values(file, incident, leaving), ours, rtol=RADIANCE_JITTER)


def test_a_trees_flux_is_kept_on_the_klems_basis(tmp_path: FilePath) -> None:
    values = np.random.default_rng(9).random(16**2) * 0.3
    file = tree_file(tmp_path, 4, "{ " + " ".join(f"{v:.6f}" for v in values) + " }")
    tree = read_bsdf(file).get(Path.transmission_back)
    solid = KLEMS_FULL.projected_solid_angles
    klems = float(solid @ tree.klems(KLEMS_FULL) @ solid)
    assert klems == pytest.approx(math.pi**2 * values.mean(), rel=2e-3)
    grid = (np.arange(40) + 0.5) / 40
    xy = disc_from_square(*(axis.ravel() for axis in np.meshgrid(grid, grid)))
    incident = np.column_stack([xy, np.sqrt(1 - (xy**2).sum(1))])
    assert tree.hemispherical(incident).mean() == pytest.approx(math.pi * values.mean(), rel=2e-3)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{ 1 2 3 }", "3 values"),
        ("{ 1", "closing brace"),
        ("1 2", "opening brace"),
        ("{ 1 } 2", "after the end"),
        ("{ x }", "not a number"),
        ("{ { 1 } { 2 } }", "opening brace|parts"),
    ],
)
def test_a_malformed_tree_says_what_is_wrong(text: str, words: str) -> None:
    with pytest.raises(TreeError, match=words):
        parse_tree(text, 3)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("LBNL/Klems Full", "LBNL/Klems Half", "LBNL/Klems Half"),
        ("<UpperTheta>25", "<UpperTheta>24", "AngleBasis"),
        (">Columns<", ">Diagonals<", "Diagonals"),
        ("Transmission Front", "Transmission Sideways", "Transmission Sideways"),
        ("<Optical>", "<Optical><Layer></Layer>", "Optical/Layer"),
        ("6.3661977e-03", "nan", "not finite"),
        ("6.3661977e-03", "-1", "negative"),
        ("6.3661977e-03,", "", "21024 values|incomplete"),
        ("6.3661977e-03", "many", "not a number"),
        ("</WindowElement>", "", "not XML"),
        (">Visible<", ">NIR<", "no visible or solar"),
    ],
)
def test_a_wrong_file_is_refused_by_name(prism_file: FilePath, old: str, new: str, words: str) -> None:
    text = prism_file.read_text()
    assert old in text
    prism_file.write_text(
        text.replace(old, new) if old == "LBNL/Klems Full" or ">Vis" in old else text.replace(old, new, 1)
    )
    with pytest.raises(InputError, match=words) as caught:
        read_bsdf(prism_file)
    assert str(prism_file) in str(caught.value)


def test_checks_find_created_light_broken_reciprocity_and_a_dark_back() -> None:
    assert all(finding.holds for finding in check_bsdf(prism(0.8)))
    failed = {finding.check for finding in check_bsdf(prism(1.2)) if not finding.holds}
    assert failed == {"energy"}
    one_way = prism()
    tables = dict(one_way.scattering)
    back = tables[Spectrum.visible, Path.transmission_back].klems(KLEMS_FULL)
    tables[Spectrum.visible, Path.transmission_back] = KlemsMatrix(KLEMS_FULL, back.T.copy())
    failed = {f.check for f in check_bsdf(Bsdf("x", "", "test", tables)) if not f.holds}
    assert "reciprocity" in failed
    tables[Spectrum.visible, Path.transmission_back] = KlemsMatrix(KLEMS_FULL, 0.5 * back)
    failed = {f.check for f in check_bsdf(Bsdf("x", "", "test", tables)) if not f.holds}
    assert failed == {"reciprocity", "front and back"}


def scan_text(kind: str, theta: float, phi: float, up: float = 90, transmittance: float = 0.6) -> str:
    lines = ['#sample_name "opal"', f"#format: theta phi {kind}", f"#intheta {theta}", f"#inphi {phi}", f"#upphi {up}"]
    for out_theta in np.arange(91.25, 180, 2.5):
        for out_phi in np.arange(0, 360, 5):
            cosine = abs(math.cos(math.radians(out_theta)))
            value = transmittance / math.pi * (cosine if kind == "DSF" else 1)
            lines.append(f"{out_theta} {out_phi} {value:.8f}")
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("kind", ["DSF", "BTDF"])
def test_a_lambertian_scan_has_its_transmittance(tmp_path: FilePath, kind: str) -> None:
    file = tmp_path / "opal.txt"
    file.write_text(scan_text(kind, 30, 0))
    read = read_bsdf(file)
    assert {path for _, path in read.scattering} == {Path.transmission_back}  # the source is on the room's side
    value = read.get(Path.transmission_back).hemispherical(np.array([[0.5, 0.0, -0.866]]))
    assert value[0] == pytest.approx(0.6, rel=1e-3)


def test_upphi_turns_a_scan(tmp_path: FilePath) -> None:
    """With `#upphi 0`, phi 0 is up: a source at phi 0 shines down into the sample, so its light travels down."""
    for up, expected in ((0.0, [0.0, -0.5]), (90.0, [-0.5, 0.0])):
        file = tmp_path / f"up{up:.0f}.txt"
        file.write_text(scan_text("BTDF", 30, 0, up))
        scan = read_bsdf(file).get(Path.transmission_back).scans[0]
        np.testing.assert_allclose(scan.incident[:2], expected, atol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("#format: theta phi BTDF", "#format: theta phi LUX", "#format"),
        ("#intheta 30", "", "incident angle"),
        ("#intheta 30", "#intheta 200", "200"),
        ("#upphi 90", "#upphi north", "#upphi"),
        ("91.25 0 0.19098593", "91.25 0 -1", "negative"),
        ("91.25 0 0.19098593", "91.25 zero 1", "line 6"),
        ("91.25 5 0.19098593", "91.25 5", "line 7"),
        ("#upphi 90", "#upphi 90\n#colorimetry: CIE-XYZ", "columns"),
    ],
)
def test_a_wrong_scan_is_refused_by_name(tmp_path: FilePath, old: str, new: str, words: str) -> None:
    file = tmp_path / "scan.txt"
    text = scan_text("BTDF", 30, 0)
    assert old in text
    file.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=words):
        read_bsdf(file)


def test_the_command_checks_and_exports(
    prism_file: FilePath, tmp_path: FilePath, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.xml"
    assert run_command(["bsdf", str(prism_file), "--export", str(out)]) == 0
    assert "reciprocity" in capsys.readouterr().out
    np.testing.assert_allclose(
        read_bsdf(out).get(Path.transmission_front).klems(KLEMS_FULL),
        prism().get(Path.transmission_front).klems(KLEMS_FULL),
        rtol=1e-6,
    )
    prism_file.write_text("no product")
    assert run_command(["bsdf", str(prism_file)]) == WRONG_USE
    assert "neither" in capsys.readouterr().err


SAMPLES = os.environ.get("TRANSOM_BSDF_SAMPLES")


@pytest.mark.skipif(SAMPLES is None, reason="TRANSOM_BSDF_SAMPLES does not name a folder of BSDF files")
def test_sample_files_are_read_as_radiance_reads_them() -> None:
    files = sorted(FilePath(SAMPLES or ".").glob("*.xml"))
    assert files
    for file in files:
        read = read_bsdf(file)
        for (spectrum, path), table in read.scattering.items():
            is_dark = not table.klems(KLEMS_FULL).any()  # Radiance takes the other side's then
            if spectrum is Spectrum.visible and not is_dark:
                incident = random_directions(100, path.incident_sign, 1)
                leaving = random_directions(100, path.exit_sign, 2)
                ours, theirs = table.evaluate(incident, leaving), radiance_values(file, incident, leaving)
                np.testing.assert_allclose(theirs, ours, rtol=RADIANCE_JITTER, atol=1e-4, err_msg=f"{file.name} {path}")
