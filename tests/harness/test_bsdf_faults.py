"""Damaged product files: whatever is done to one, it is read, or refused by its name and by what is wrong with it."""

from __future__ import annotations

import random
import re
from pathlib import Path as FilePath

import numpy as np
import pytest

from transom.bsdf import Bsdf, Path, Spectrum, read_bsdf
from transom.bsdf.bsdf import KlemsMatrix
from transom.bsdf.checks import check_bsdf
from transom.bsdf.directions import KLEMS_FULL
from transom.bsdf.window_xml import write_klems_xml
from transom.cli import run_command
from transom.errors import InputError

MUTATIONS = 40
SOME = KLEMS_FULL.centres[::7]


@pytest.fixture
def pane(tmp_path: FilePath) -> FilePath:
    """A pane that sends 0.9 straight on and 0.08 back."""
    identity = np.diag(1 / KLEMS_FULL.projected_solid_angles)
    shares = {Path.transmission_front: 0.9, Path.transmission_back: 0.9, Path.reflection_front: 0.08}
    scattering = {(Spectrum.visible, p): KlemsMatrix(KLEMS_FULL, share * identity) for p, share in shares.items()}
    file = tmp_path / "pane.xml"
    write_klems_xml(file, Bsdf("pane", "", "test", scattering))
    return file


def tree_text(data: str) -> str:
    return (
        '<?xml version="1.0"?><WindowElement><Optical><Layer><Material><Name>tree</Name></Material><DataDefinition>'
        "<IncidentDataStructure>TensorTree3</IncidentDataStructure></DataDefinition><WavelengthData>"
        "<Wavelength>Visible</Wavelength><WavelengthDataBlock><WavelengthDataDirection>Transmission Front"
        "</WavelengthDataDirection><AngleBasis>LBNL/Shirley-Chiu</AngleBasis>"
        f"<ScatteringData>{data}</ScatteringData></WavelengthDataBlock></WavelengthData></Layer></Optical></WindowElement>"
    )


def replaced(text: str, pattern: str, new: str) -> str:
    changed, count = re.subn(pattern, new, text, count=1, flags=re.DOTALL)
    assert count == 1
    return changed


@pytest.mark.parametrize(
    ("pattern", "new", "words"),
    [
        (r"<ThetaBounds>.*?</ThetaBounds>", "", "ThetaBounds"),
        (r"<nPhis>8", "<nPhis>9", "AngleBasis"),
        (r"<nPhis>8", "<nPhis>", "AngleBasisBlock"),
        (r"<AngleBasisBlock>.*?</AngleBasisBlock>", "", "AngleBasis"),
        (r"<ColumnAngleBasis>LBNL/Klems Full", "<ColumnAngleBasis>LBNL/Klems Quarter", "ColumnAngleBasis"),
        (r"<RowAngleBasis>LBNL/Klems Full", "<RowAngleBasis>", "RowAngleBasis"),
        (r"(<ScatteringData>\s*)\S+,", r"\1nan,", "not finite"),
        (r"(<ScatteringData>\s*)\S+,", r"\1inf,", "not finite"),
        (r"(<ScatteringData>\s*)\S+,", r"\1-3,", "negative"),
        (r"(<ScatteringData>\s*)\S+,", r"\1", "21024 values"),
        (r"(<ScatteringData>\s*)\S+,", r"\1 1, 2,", "21026 values"),
        (r"(<ScatteringData>\s*)\S+,", r"\1 1;2,", "not a number"),
        (r"Transmission Back", "Transmission Front", "twice"),
        (r"<IncidentDataStructure>Columns", "<IncidentDataStructure>", "IncidentDataStructure"),
        (r"<IncidentDataStructure>Columns", "<IncidentDataStructure>TensorTree5", "TensorTree5"),
        (r"<DataDefinition>.*</DataDefinition>", "", "DataDefinition"),
        (r"<Wavelength unit=.Integral.>Visible</Wavelength>", "", "Wavelength"),
        (r"unit=.Meter.", 'unit="cubit"', "Thickness.unit"),
        (r"encoding=.UTF-8.", 'encoding="nothing"', "not XML"),
        (r"WindowElement (.*)</WindowElement>", r"Luminaire \1</Luminaire>", "root element"),
    ],
)
def test_a_damaged_klems_file_says_what_is_wrong(pane: FilePath, pattern: str, new: str, words: str) -> None:
    pane.write_text(replaced(pane.read_text(), pattern, new))
    with pytest.raises(InputError, match=re.escape(words)) as caught:
        read_bsdf(pane)
    assert str(pane) in str(caught.value)


def test_names_in_mixed_case_are_understood(pane: FilePath) -> None:
    text = pane.read_text().replace("Visible", "vISIBLE").replace("Transmission Front", "transmission  FRONT")
    pane.write_text(text.replace("LBNL/Klems Full", "lbnl/KLEMS full").replace(">Columns<", ">columns<"))
    read = read_bsdf(pane)
    assert read.get(Path.transmission_front).hemispherical(np.array([[0, 0, 1.0]]))[0] == pytest.approx(0.9)


def test_a_file_cut_anywhere_is_refused(pane: FilePath) -> None:
    content = pane.read_bytes()
    rng = random.Random(1)
    for _ in range(MUTATIONS):
        pane.write_bytes(content[: rng.randrange(len(content) - 20)])
        with pytest.raises(InputError):
            read_bsdf(pane)


@pytest.mark.parametrize("kind", ["klems", "tree", "scan"])
def test_random_damage_is_read_or_refused_but_never_a_surprise(kind: str, pane: FilePath) -> None:
    """Bytes changed, doubled and dropped: what is not refused still has finite values of no negative sign."""
    if kind == "tree":
        pane.write_text(tree_text("{ { 1 } { 2 } { 3 } { 4 } { 1 2 3 4 5 6 7 8 } { 6 } { 7 } { 8 } }"))
    elif kind == "scan":
        rows = "\n".join(f"{150 + theta} {phi} 0.3" for theta in range(0, 30, 5) for phi in range(0, 360, 60))
        pane.write_text(f"#format: theta phi BTDF\n#intheta 20\n#inphi 30\n#upphi 90\n{rows}\n")
    content = pane.read_bytes()
    rng = random.Random(kind)
    for _ in range((3 if kind == "klems" else 10) * MUTATIONS):
        damaged = bytearray(content)
        # Of the long file mostly the header, where each byte means something.
        reach = len(damaged) if kind != "klems" or rng.random() < 0.3 else 4000
        for _ in range(rng.randint(1, 4)):
            place = rng.randrange(min(reach, len(damaged)))
            choice = rng.random()
            if choice < 0.5:
                damaged[place] = rng.choice(b"0123456789-.,<>/{} naeE#\xff")
            elif choice < 0.75:
                del damaged[place : place + rng.randint(1, 40)]
            else:
                damaged[place:place] = damaged[place : place + rng.randint(1, 40)]
        pane.write_bytes(bytes(damaged))
        try:
            read = read_bsdf(pane)
        except InputError:
            continue
        for table in read.scattering.values():
            values = table.evaluate(SOME, SOME[::-1])
            assert np.isfinite(values).all()
            assert (values >= 0).all()


def test_a_tree_without_end_is_refused(pane: FilePath) -> None:
    pane.write_text(tree_text("{" * 5000))
    with pytest.raises(InputError, match="levels deep"):
        read_bsdf(pane)


@pytest.mark.parametrize(
    ("path", "share", "words"), [(Path.transmission_front, 1.26, "1.2600"), (Path.reflection_front, 0.2, "1.1000")]
)
def test_created_light_is_reported(
    pane: FilePath, capsys: pytest.CaptureFixture[str], path: Path, share: float, words: str
) -> None:
    """Transmitted alone, or only together with what is reflected."""
    tables = dict(read_bsdf(pane).scattering)
    tables[Spectrum.visible, path] = KlemsMatrix(KLEMS_FULL, np.diag(share / KLEMS_FULL.projected_solid_angles))
    write_klems_xml(pane, Bsdf("pane", "", "test", tables))
    assert run_command(["bsdf", str(pane)]) == 1
    broken = [line for line in capsys.readouterr().out.splitlines() if "broken energy" in line]
    assert any(words in line for line in broken)
    assert any(not finding.holds for finding in check_bsdf(read_bsdf(pane)))
