"""JUnit XML of verdicts: one test suite a suite, one test case a judged quantity, nothing ever skipped.

A FAIL is a failure. INCONCLUSIVE, NO_REFERENCE and CRASHED are errors: nothing was shown, and a CI server that counts
skipped cases as harmless must not hide it. A suite in which nothing was judged holds one error that says so.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from xml.etree import ElementTree as ET

from transom.comparison import Comparison
from transom.judge import Outcome, Verdict

ELEMENTS = {
    Outcome.PASS: "",
    Outcome.FAIL: "failure",
    Outcome.INCONCLUSIVE: "error",
    Outcome.NO_REFERENCE: "error",
    Outcome.CRASHED: "error",
}
"""What each outcome is in JUnit; "" is a test case without a child."""

BASELINE_ENDING = " baseline"
"""Of the name of a suite that is compared with its blessed baseline, and not with references."""

NOTHING_JUDGED = "nothing was judged: no comparison has a tolerance, or none was made"

_NOT_XML = re.compile("[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 does not allow, section 2.2."""


def junit_xml(judged: Sequence[tuple[Comparison, Sequence[Verdict]]]) -> bytes:
    """The verdicts of some suites as a JUnit document (UTF-8). Numbers are those of verdicts.json, with six digits."""
    root = ET.Element("testsuites", name="transom")
    for comparison, verdicts in judged:
        root.append(_suite(comparison, verdicts))
    for name in ("tests", "failures", "errors", "skipped"):
        root.set(name, str(sum(int(suite.get(name, "0")) for suite in root)))
    ET.indent(root)
    document: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return document + b"\n"


def case_names(verdicts: Iterable[Verdict]) -> list[str]:
    """A name for each verdict that leads to its case, each once: sensors of one set are numbered in their order."""
    plain = [_plain_name(verdict) for verdict in verdicts]
    repeated = {name for name, count in Counter(plain).items() if count > 1}
    seen: Counter[str] = Counter()
    names = []
    for name in plain:
        names.append(f"{name} [{seen[name]}]" if name in repeated else name)
        seen[name] += 1
    return names


def reproduce_command(suite: str, scene: str) -> str:
    """What renders, compares and judges a case again. A comparison with a baseline is named "SUITE baseline"."""
    if suite.endswith(BASELINE_ENDING):
        return f"transom check --suite {suite.removesuffix(BASELINE_ENDING)}"
    return f"transom run {suite}" + (f" --scene {scene}" if scene else "")


def _suite(comparison: Comparison, verdicts: Sequence[Verdict]) -> ET.Element:
    suite = ET.Element("testsuite", name=_clean(comparison.suite), tests=str(max(len(verdicts), 1)))
    kinds = Counter(ELEMENTS[verdict.outcome] for verdict in verdicts)
    suite.set("failures", str(kinds["failure"]))
    suite.set("errors", str(kinds["error"] if verdicts else 1))
    suite.set("skipped", "0")
    properties = ET.SubElement(suite, "properties")
    ET.SubElement(properties, "property", name="title", value=_clean(comparison.title))
    ET.SubElement(properties, "property", name="reproduce", value=reproduce_command(comparison.suite, ""))
    for name, verdict in zip(case_names(verdicts), verdicts, strict=True):
        suite.append(_case(comparison.suite, name, verdict))
    if not verdicts:
        case = ET.SubElement(suite, "testcase", classname=f"transom.{comparison.suite}", name="suite")
        error = ET.SubElement(case, "error", type="NOTHING_JUDGED", message=NOTHING_JUDGED)
        error.text = f"reproduce: {reproduce_command(comparison.suite, '')}"
    return suite


def _case(suite: str, name: str, verdict: Verdict) -> ET.Element:
    classname = ".".join(part for part in ("transom", suite, verdict.scene) if part)
    case = ET.Element("testcase", classname=_clean(classname), name=_clean(name))
    numbers = _numbers(verdict)
    kind = ELEMENTS[verdict.outcome]
    if not kind:
        if numbers:
            ET.SubElement(case, "system-out").text = _clean("\n".join(numbers))
        return case
    message = f"{verdict.outcome}: {', '.join(numbers) or verdict.reason}"
    child = ET.SubElement(case, kind, type=str(verdict.outcome), message=_clean(message))
    lines = [f"verdict: {verdict.outcome}", *numbers, f"reason: {verdict.reason}"]
    if verdict.reference:
        lines.append(f"reference: {verdict.reference}")
    if verdict.batches_needed is not None:
        lines.append(f"to decide: {verdict.batches_needed} batches of the reference")
    lines.append(f"reproduce: {reproduce_command(suite, verdict.scene)}")
    child.text = _clean("\n".join(lines))
    return case


def _numbers(verdict: Verdict) -> list[str]:
    """difference, k u, b and tolerance, with the unit that the quantity's name ends in; none for a missing case."""
    unit = {"percent": " %", "mm": " mm"}.get(verdict.quantity.rpartition("_")[2], "")
    found = (
        ("difference", verdict.difference),
        ("k u", verdict.expanded_uncertainty),
        ("b", verdict.numerical_bias),
        ("tolerance", verdict.tolerance),
    )
    return [f"{name} = {value:.6g}{unit}" for name, value in found if value is not None]


def _plain_name(verdict: Verdict) -> str:
    place = (verdict.scene, verdict.view, verdict.region, verdict.condition, verdict.method)
    return f"{verdict.quantity or 'case'}: " + " / ".join(part for part in place if part)


def _clean(text: str) -> str:
    return _NOT_XML.sub("\N{REPLACEMENT CHARACTER}", text)
