"""JUnit XML: its structure as CI servers read it, and what becomes a failure, an error, and never a skip."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import pytest

from transom.comparison import COMPARISON_FORMAT, Comparison
from transom.judge import Missing, Outcome, Subject, ToleranceFile, Verdict, judge
from transom.report.junit import case_names, junit_xml

ATTRIBUTES = {
    "testsuites": {"name", "tests", "failures", "errors", "skipped"},
    "testsuite": {"name", "tests", "failures", "errors", "skipped"},
    "testcase": {"classname", "name"},
    "properties": set(),
    "property": {"name", "value"},
    "failure": {"type", "message"},
    "error": {"type", "message"},
    "system-out": set(),
}
CHILDREN = {
    "testsuites": {"testsuite"},
    "testsuite": {"properties", "testcase"},
    "testcase": {"failure", "error", "system-out"},
    "properties": {"property"},
}


def tolerances() -> ToleranceFile:
    rules = [{"quantity": name, "tolerance": 3.0, "reason": "stated"} for name in ("bias_percent", "sensor_percent")]
    return ToleranceFile.model_validate({"format": 1, "tolerances": rules})


def subject(difference: float, noise: float = 0.01, quantity: str = "bias_percent") -> Subject:
    return Subject(quantity, "room", "door", "floor", "noon", "volumes", "mitsuba", difference, noise, 0.1, 32)


def suite(name: str, subjects: list[Subject], *missing: Missing) -> tuple[Comparison, list[Verdict]]:
    return Comparison(COMPARISON_FORMAT, name, name.title()), judge(subjects, missing, tolerances())


def parsed(*judged: tuple[Comparison, list[Verdict]]) -> ET.Element:
    root = ET.fromstring(junit_xml(judged))
    check_structure(root)
    return root


def check_structure(root: ET.Element) -> None:
    """What the JUnit schemas of CI servers ask for: known elements and attributes, and counts that add up."""
    assert root.tag == "testsuites"
    for element in root.iter():
        assert set(element.keys()) == ATTRIBUTES[element.tag]
        assert {child.tag for child in element} <= CHILDREN.get(element.tag, set())
    for element in root.iter("testsuite"):
        cases = element.findall("testcase")
        assert int(element.get("tests", "")) == len(cases) > 0
        assert int(element.get("failures", "")) == len(element.findall("testcase/failure"))
        assert int(element.get("errors", "")) == len(element.findall("testcase/error"))
        assert all(len(case) <= 1 for case in cases)
        names = [(case.get("classname"), case.get("name")) for case in cases]
        assert len(names) == len(set(names)), "a name leads to one case"
    for name in ("tests", "failures", "errors"):
        assert int(root.get(name, "")) == sum(int(element.get(name, "")) for element in root)
    assert root.get("skipped") == "0"


def test_failures_are_failures_and_everything_undecided_is_an_error() -> None:
    gone = Missing(Outcome.NO_REFERENCE, "room", "door", "noon", "", "no reference: transom run references")
    crash = Missing(Outcome.CRASHED, "hall", "door", "noon", "rays", "out of memory")
    subjects = [subject(0.5), subject(9.0, quantity="sensor_percent"), subject(2.5, noise=1.0)]
    root = parsed(suite("rooms", subjects, gone, crash))
    children = [[child.tag for child in case] for case in root.iter("testcase")]
    assert children == [["system-out"], ["failure"], ["error"], ["error"], ["error"]]
    types = [child.get("type") for case in root.iter("testcase") for child in case if child.tag != "system-out"]
    assert types == ["FAIL", "INCONCLUSIVE", "NO_REFERENCE", "CRASHED"]
    assert (root.get("tests"), root.get("failures"), root.get("errors")) == ("5", "1", "3")


def test_failure_says_what_is_wrong_and_how_to_see_it_again() -> None:
    root = parsed(suite("rooms", [subject(-9.0)]))
    case = root.find("testsuite/testcase")
    assert case is not None
    assert case.get("classname") == "transom.rooms.room"
    assert case.get("name") == "bias_percent: room / door / floor / noon / volumes"
    failure = case.find("failure")
    assert failure is not None and failure.text is not None
    for part in ("difference = -9 %", "k u = ", "b = 0.1 %", "tolerance = 3 %"):
        assert part in str(failure.get("message")) and part in failure.text
    assert "reason: stated" in failure.text
    assert "reproduce: transom run rooms --scene room" in failure.text


def test_inconclusive_says_how_many_batches_would_decide() -> None:
    _, verdicts = suite("rooms", [subject(2.5, noise=1.0)])
    error = parsed(suite("rooms", [subject(2.5, noise=1.0)])).find(".//error")
    assert error is not None
    assert f"to decide: {verdicts[0].batches_needed} batches" in str(error.text)


def test_missing_reference_carries_its_own_message() -> None:
    gone = Missing(Outcome.NO_REFERENCE, "room", "door", "noon", "", "no reference: transom run references")
    error = parsed(suite("rooms", [], gone)).find(".//error")
    assert error is not None
    assert error.get("message") == "NO_REFERENCE: no reference: transom run references"


def test_sensors_of_one_set_have_names_of_their_own() -> None:
    _, verdicts = suite("rooms", [subject(value, quantity="sensor_percent") for value in (0.1, 0.2, 0.3)])
    assert len(set(case_names(verdicts))) == 3
    assert case_names(verdicts)[2].endswith("[2]")


def test_suite_in_which_nothing_was_judged_is_an_error() -> None:
    root = parsed(suite("empty", []), suite("rooms", [subject(0.5)]))
    assert [element.get("errors") for element in root] == ["1", "0"]


@pytest.mark.parametrize("message", ['<oops> & "quotes"', "a\x00b\x1bc", "é 😀 \ufffe"])
def test_any_message_gives_a_document_that_parses(message: str) -> None:
    parsed(suite("rooms", [], Missing(Outcome.CRASHED, "room", "door", "noon", "rays", message)))
