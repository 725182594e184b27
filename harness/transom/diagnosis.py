"""Diagnosis: what a pattern of drifts points to, in words. It judges nothing: it reads what was judged.

Light goes one way: geometry, then sun and sky, then what they reflect. The first stage that drifted is named, and what
follows from it is said to follow.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from transom.baseline import Drift
from transom.measures import SEEN, UP_CLOSE

LIGHT_CATEGORIES = ("sky", "sky in blocks", "indirect", "indirect in blocks", "emitted", "emitted in blocks", "sun")

UNEVEN_RATIO = 2.0
"""Reflected light that changes this many times as much in one region as in another did not change by one factor."""

FLUX_PERCENT = 0.1
"""An energy balance that is off by more makes or loses flux, beyond the spread of its audit (about 0.03 %)."""

BALANCE_SHARE = 0.2
"""A transfer that is too strong or weak makes or loses about as much flux as indirect light changes; where the balance
is off by less than this share of that change, light is not made but put elsewhere."""

LOST_PERCENT, FEW_FACES = 20.0, 0.05
"""Faces whose light, seen from up close, changed by more, if they are at most this share of all, are lost or hidden."""

NAMED = 4
"""So many places are named, of those that drifted most."""


def diagnose(failed: Sequence[Drift], rows: Sequence[Drift]) -> list[str]:
    """Sentences on what drifted, most basic first. failed: drifts that are too large; rows: all that were judged."""
    found = [*_question(failed), *_geometry(failed, rows), *_shadows(failed)]
    sources = [*_level("sun", failed, rows), *_sky(failed, rows)]
    found += sources
    reflected = _interreflection(failed, rows)
    if reflected and found:
        found.append("Indirect light changed with it.")
    else:
        found += reflected
    if not found and failed:
        found.append(f"Drifted: {_places(failed)}.")
    return found


def _question(failed: Sequence[Drift]) -> list[str]:
    names = sorted({row.place.removesuffix(" is as it was") for row in failed if row.category == "inputs"})
    return [f"The question changed, not the answer alone: {', '.join(names)}."] if names else []


def _geometry(failed: Sequence[Drift], rows: Sequence[Drift]) -> list[str]:
    counted = [row for row in failed if row.category == "geometry"]
    seen = _largest([row for row in failed if row.category == SEEN])
    found = [f"Geometry: {row.place} {_number(row.before)} → {_number(row.now)} ({row.scene})." for row in counted]
    near = [row for row in rows if row.category == UP_CLOSE]
    changed = [row for row in near if not abs(row.difference) <= LOST_PERCENT]
    if changed and len(changed) <= FEW_FACES * len(near):
        named = ", ".join(f"{row.place} in {row.scene}" for row in _largest(changed)[:NAMED])
        found.append(f"Geometry: from up close something else is seen in place of {len(changed)}: {named}.")
    if seen:
        lost = [row for row in seen if not row.now]
        words = "are no longer seen" if lost else "are seen otherwise"
        named = ", ".join(f"{row.place} in {row.scene}" for row in (lost or seen)[:NAMED])
        found.append(f"Geometry: faces {words} ({len(lost or seen)}): {named}.")
    return found


def _shadows(failed: Sequence[Drift]) -> list[str]:
    """By surface, how far the sun patch has moved in space."""
    surfaces: dict[tuple[str, str, str], dict[str, float]] = {}
    for row in failed:
        if row.category == "sun shadow" and math.isfinite(row.difference):
            surface, _, what = row.place.rpartition(", ")
            surfaces.setdefault((row.case, row.method, surface), {})[what] = row.difference
    found = []
    for (case, _, surface), moved in surfaces.items():
        along = [moved.get(f"along {axis}", 0.0) for axis in "xyz"]
        words = f"moved by {math.hypot(*along):.1f} mm (x {along[0]:+.1f}, y {along[1]:+.1f}, z {along[2]:+.1f})"
        if "edges outwards" in moved:
            words += f", its edges by {moved['edges outwards']:+.1f} mm outwards"
        found.append((math.hypot(*along), f"Shadow of the sun on {surface} {words} ({case})."))
    found.sort(key=lambda entry: -entry[0])
    sentences = [text for _, text in found[:NAMED]]
    gone = {row.place for row in failed if row.category == "sun shadow" and not math.isfinite(row.difference)}
    if gone:
        sentences.append(f"Sun patches appeared or vanished: {', '.join(sorted(gone)[:NAMED])}.")
    return sentences


def _level(category: str, failed: Sequence[Drift], rows: Sequence[Drift]) -> list[str]:
    """Sunlight whose level changed, whatever its edges did."""
    hit = [row for row in failed if row.category == category]
    if not hit:
        return []
    return [f"Direct {category}light: {_range(_of(category, rows))} by region."]


def _sky(failed: Sequence[Drift], rows: Sequence[Drift]) -> list[str]:
    if not any(row.category in ("sky", "sky in blocks") for row in failed):
        return []
    blocks = [row.difference for row in rows if row.category == "sky in blocks" and math.isfinite(row.difference)]
    means = _of("sky", rows)
    words = f"Direct sky light: {_range(means)} by region"
    if (means and min(means) < 0 < max(means)) or (blocks and min(blocks) < -0.2 * max(blocks) < 0):
        return [
            f"{words}, more here and less there: its distribution changed (sky turned, or openings see other parts)."
        ]
    return [f"{words}, one way everywhere: its level changed (sky, glass, or view coefficients)."]


def _interreflection(failed: Sequence[Drift], rows: Sequence[Drift]) -> list[str]:
    hit = [row for row in failed if row.category in ("indirect", "indirect in blocks", "energy")]
    if not hit:
        return []
    means = _of("indirect", rows)
    balance = _of("energy", rows)
    made = max(balance, key=abs, default=0.0)
    sweeps = [row for row in failed if row.category == "plan" and row.place == "sweeps"]
    words = f"Interreflection: indirect light {_range(means)} by region, energy balance {made:+.2f} %"
    if sweeps:
        words += f", sweeps {_number(sweeps[0].before)} → {_number(sweeps[0].now)}"
    return [f"{words}. {_cause(means, made, bool(sweeps) and _fewer(sweeps[0]))}"]


def _cause(means: Sequence[float], made: float, fewer_sweeps: bool) -> str:
    if fewer_sweeps and made < -FLUX_PERCENT:
        return "Flux is lost: the bounces stop early."
    largest, smallest = max(map(abs, means), default=0.0), min(map(abs, means), default=0.0)
    mixed = bool(means) and min(means) < 0 < max(means)
    if mixed or largest > UNEVEN_RATIO * smallest:
        return "It changed unevenly: reflectance acts at the wrong place of the transfer, or some surface's changed."
    if abs(made) < BALANCE_SHARE * smallest:
        return (
            "The balance all but holds: reflectance acts at the wrong place of the transfer, or reflectances changed."
        )
    if made > FLUX_PERCENT:
        return "Flux is made: the transfer is too strong (form factors sum to more than 1, or reflectance is too high)."
    if made < -FLUX_PERCENT:
        return "Flux is lost: the transfer is too weak, or the bounces stop early."
    return "The balance holds: nodes gather otherwise, or what reaches the surfaces changed."


def _of(category: str, rows: Sequence[Drift]) -> list[float]:
    return [row.difference for row in rows if row.category == category and math.isfinite(row.difference)]


def _range(values: Sequence[float]) -> str:
    if not values:
        return "not measured"
    low, high = min(values), max(values)
    return f"{low:+.2f} %" if math.isclose(low, high, abs_tol=0.005) else f"{low:+.2f} to {high:+.2f} %"


def _fewer(row: Drift) -> bool:
    return row.before is not None and row.now is not None and row.now < row.before


def _largest(rows: Sequence[Drift]) -> list[Drift]:
    return sorted(rows, key=lambda row: -abs(row.difference) if math.isfinite(row.difference) else -math.inf)


def _places(rows: Sequence[Drift]) -> str:
    return "; ".join(f"{row.category}, {row.place} ({row.case})" for row in _largest(rows)[:NAMED])


def _number(value: float | None) -> str:
    return "none" if value is None else f"{value:g}"
