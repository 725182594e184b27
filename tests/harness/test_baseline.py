"""Baselines: written by blessings alone, compared exactly with the same seed and statistically with another."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from transom.baseline import Baseline, Drift, Measured, bless, drifts, read_baseline, worth_judging
from transom.diagnosis import diagnose
from transom.errors import InputError
from transom.judge import Outcome, judge, read_tolerances
from transom.measures import SEEN, TRIANGLE, UP_CLOSE, Measure, relative

TOLERANCES = Path(__file__).parents[2] / "scenes" / "tolerances.toml"
REASON = "a test that says why"


def measures(seed: int = 1, spread: float = 0.0, **factors: float) -> list[Measure]:
    """Means of light in two regions, with relative noise by seed, and what no seed changes."""
    random = np.random.default_rng(seed)
    found = []
    for category, level in (("sun", 100.0), ("sky", 60.0), ("indirect", 300.0)):
        for region in ("interior", "floor"):
            factor = factors.get(f"{category}_{region}", factors.get(category, 1.0))
            noise = 0.0 if category == "sun" else spread * random.standard_normal()
            found.append(relative(category, region, level * factor * (1 + noise), level))
    found.append(Measure("energy_percent", "energy", "imbalance", factors.get("energy", 0.0), 100.0))
    found.append(relative("plan", "sweeps", factors.get("sweeps", 12.0), 12.0))
    found.append(Measure("sun_edge_mm", "sun shadow", "floor facing up, along x", factors.get("x", 1.5), 1000.0))
    return found


def measured(*by_seed: Sequence[Measure], inputs: Mapping[str, str] | None = None) -> Measured:
    return Measured("room/view/noon/rays", "room", "view", "noon", "rays", inputs or {"scene": "a"}, by_seed)


def blessed(folder: Path, *by_seed: Sequence[Measure], reason: str = REASON) -> Baseline:
    return bless(folder / "quick.json", "quick", [measured(*(by_seed or (measures(),)))], reason, "1+build", "someone")


def compared(baseline: Baseline, now: Sequence[Measure], *, fresh_seed: bool = False) -> list[Drift]:
    return drifts(baseline.cases[0], measured(now), fresh_seed=fresh_seed)


def failed(rows: Sequence[Drift]) -> list[Drift]:
    verdicts = judge([row.subject("baseline") for row in rows], [], read_tolerances(TOLERANCES))
    assert len(verdicts) == len(rows), "every drift has a tolerance"
    return [row for row, verdict in zip(rows, verdicts, strict=True) if verdict.outcome is not Outcome.PASS]


def test_blessing_is_read_back_as_it_was_written(tmp_path: Path) -> None:
    baseline = blessed(tmp_path, measures(1, 0.001), measures(2, 0.001))
    assert read_baseline(tmp_path / "quick.json") == baseline
    assert read_baseline(tmp_path / "other.json") is None


@pytest.mark.parametrize("reason", ["", "  ", "because", "fix\n\n"])
def test_baseline_is_never_written_without_a_reason(tmp_path: Path, reason: str) -> None:
    with pytest.raises(InputError, match=r"--reason .*Say in a sentence"):
        blessed(tmp_path, reason=reason)
    assert not list(tmp_path.iterdir())


def test_history_grows_by_one_entry_with_what_moved(tmp_path: Path) -> None:
    blessed(tmp_path, measures())
    baseline = blessed(tmp_path, measures(sky=1.03), reason="the sky is brighter now")
    first, second = baseline.history
    assert (first.reason, second.reason) == (REASON, "the sky is brighter now")
    assert (second.author, second.engine) == ("someone", "1+build")
    assert first.changes == []
    (change,) = second.changes
    assert (change.category, change.before, change.after) == ("sky", 60.0, pytest.approx(61.8))
    assert change.change == pytest.approx(3.0)


@pytest.mark.parametrize("edit", ["value", "history", "reason"])
def test_baseline_edited_by_hand_is_refused(tmp_path: Path, edit: str) -> None:
    blessed(tmp_path, measures())
    blessed(tmp_path, measures(sky=1.01), reason="the sky is brighter now")
    path = tmp_path / "quick.json"
    content = json.loads(path.read_text())
    if edit == "value":
        content["cases"][0]["measures"][2]["value"] *= 1.05
    elif edit == "history":
        del content["history"][0]
    else:
        content["history"][0]["reason"] = "another reason than it was"
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match=r"quick\.json: .*(changed|grows)"):
        read_baseline(path)


def test_same_seed_is_compared_exactly_and_a_drift_of_a_quarter_percent_shows(tmp_path: Path) -> None:
    baseline = blessed(tmp_path, *(measures(seed, 0.001) for seed in range(1, 9)))
    assert failed(compared(baseline, measures(1, 0.001))) == []
    rows = failed(compared(baseline, measures(1, 0.001, indirect=1.0025)))
    assert {row.category for row in rows} == {"indirect"}
    assert failed(compared(baseline, measures(1, 0.001, indirect=1.0015))) == []


def test_unchanged_engine_passes_with_fresh_seeds_every_time(tmp_path: Path) -> None:
    """200 times, with the seed spread that rooms have (0.06 % of a region's mean)."""
    baseline = blessed(tmp_path, *(measures(seed, 0.0006) for seed in range(1, 17)))
    tolerances = read_tolerances(TOLERANCES)
    for seed in range(100, 300):
        rows = worth_judging(compared(baseline, measures(seed, 0.0006), fresh_seed=True), tolerances)
        assert len(rows) == len(measures()), "all of them can be judged"
        assert failed(rows) == []


def test_two_percent_too_much_shows_with_every_fresh_seed(tmp_path: Path) -> None:
    baseline = blessed(tmp_path, *(measures(seed, 0.0006) for seed in range(1, 17)))
    for seed in range(100, 200):
        rows = failed(compared(baseline, measures(seed, 0.0006, indirect=1.02), fresh_seed=True))
        assert {row.category for row in rows} == {"indirect"}


def test_what_another_seed_moves_too_much_is_not_judged_with_fresh_seeds(tmp_path: Path) -> None:
    baseline = blessed(tmp_path, *(measures(seed, 0.02) for seed in range(1, 9)))
    rows = worth_judging(compared(baseline, measures(50, 0.02), fresh_seed=True), read_tolerances(TOLERANCES))
    assert {row.category for row in rows} == {"sun", "energy", "plan", "sun shadow"}


def test_changed_input_and_measures_that_come_or_go_fail_by_name(tmp_path: Path) -> None:
    baseline = blessed(tmp_path)
    rows = failed(drifts(baseline.cases[0], measured(measures(), inputs={"scene": "b"}), fresh_seed=False))
    assert [row.place for row in rows] == ["scene is as it was"]
    rows = failed(compared(baseline, measures()[1:]))
    assert [(row.category, row.place, math.isnan(row.difference)) for row in rows] == [("sun", "interior", True)]


@pytest.mark.parametrize(
    ("now", "words"),
    [
        ({"sky": 1.01}, "its level changed"),
        ({"sky_interior": 1.02, "sky_floor": 0.97}, "its distribution changed"),
        ({"indirect": 1.02, "energy": 0.008}, "the transfer is too strong"),
        ({"indirect": 0.9, "energy": -0.02, "sweeps": 3.0}, "the bounces stop early"),
        ({"indirect_interior": 1.06, "indirect_floor": 0.97}, "reflectance acts at the wrong place"),
        ({"indirect": 1.4, "energy": 0.014}, "The balance all but holds: reflectance acts at the wrong place"),
        ({"x": 1.51}, "Shadow of the sun on floor facing up moved by 10.0 mm (x +10.0"),
        ({"sky": 1.01, "indirect": 1.01}, "Indirect light changed with it"),
    ],
)
def test_drifts_are_told_by_what_they_point_to(tmp_path: Path, now: dict[str, float], words: str) -> None:
    rows = compared(blessed(tmp_path), measures(1, 0.0, **now))
    assert words in " ".join(diagnose(failed(rows), rows))


def test_buried_faces_are_told_by_the_blessed_seed_alone(tmp_path: Path) -> None:
    """Dark by every blessed seed, lit by a ray of another by chance: no drift; by the same seed it is one."""
    dark, lit = (relative(UP_CLOSE, "leg", value, 16.0) for value in (0.0, 1.5))
    baseline = blessed(tmp_path, [dark], [dark])
    assert compared(baseline, [lit], fresh_seed=True) == []
    assert len(failed(compared(baseline, [lit]))) == 1


def test_faces_that_some_seeds_alone_find_are_not_compared(tmp_path: Path) -> None:
    """The outer side of a frame: in full sun by one seed of sixteen, in the dark by the others."""
    sunny = [relative(UP_CLOSE, "frame", value, 9.0) for value in (7.0, 6.5, 53486.0, *[7.5] * 13)]
    steady = [relative(UP_CLOSE, "sill", value, 900.0) for value in (905.0, 890.0, *[900.0] * 14)]
    baseline = blessed(tmp_path, *([lit, seen] for lit, seen in zip(sunny, steady, strict=True)))
    now = [relative(UP_CLOSE, "frame", 53486.0, 9.0), relative(UP_CLOSE, "sill", 1200.0, 900.0)]
    assert [row.place for row in failed(compared(baseline, now))] == ["sill"]
    assert [row.place for row in compared(baseline, now, fresh_seed=True)] == ["sill"]


def test_faces_that_go_dark_with_a_fresh_seed_are_told_where_a_room_sees_them(tmp_path: Path) -> None:
    """The outer side of a frame, found in the sun by sixteen seeds and not by the next; a wall is no such one."""
    places = [f"{face}{TRIANGLE}1" for face in ("frame", "wall")]
    by_seed = [[relative(UP_CLOSE, place, value, 900.0) for place in places] for value in (905.0, 890.0, *[900.0] * 14)]
    wall = Measure("broken_claims", SEEN, "wall", 400.0, 0.05)
    baseline = blessed(tmp_path, *([*seeded, wall] for seeded in by_seed))
    now = [*(relative(UP_CLOSE, place, 7.0, 900.0) for place in places), wall]
    assert [row.place for row in failed(compared(baseline, now, fresh_seed=True))] == [places[1]]
    assert [row.place for row in failed(compared(baseline, now))] == places
