"""Claims about a lit room, each with what is expected and how it is checked; the tolerances stand here with reasons."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from transom.colour import luminance
from transom.comparison import compare_methods
from transom.daylight import resolve_condition
from transom.daylight.condition import Condition
from transom.daylight.sun_disc import Sun
from transom.engine import Engine, Frame, SolveOptions, Visibility, thread_limit
from transom.errors import InputError
from transom.hard import changes
from transom.hard.rooms import Room
from transom.renderer import ImageResult
from transom.scene.model import Scene

Float64 = NDArray[np.float64]

QUICK = SolveOptions(
    target_patch_count=300, patch_rays=512, patch_opening_rays=128, node_rays=256, node_opening_rays=128
)
"""Settings of the suite's solves: a tenth of the usual patches."""

SENSOR_RAYS, SENSOR_OPENING_RAYS = 8192, 4096

ENERGY_SHARE = 0.01
"""Flux in, sampled from the openings, against flux absorbed and out: what elements of 0.2 m leave of a beam's edge."""

ROUNDING_SHARE = 2e-3
"""Single precision moves a few rays in thousands past an edge when every coordinate is rounded anew."""

NOISE_SHARE = 0.03
"""Other random numbers for every patch: 512 rays each give the light of a place a standard error below 1 %."""

AGREEMENT_PERCENT = 0.2
"""Pixels away from edges on which volumes and rays differ: 6 of a picture of 64 x 48."""


@dataclass(frozen=True)
class Seen:
    """Whether a claim holds, and what was seen."""

    holds: bool
    text: str


@dataclass(frozen=True)
class Claim:
    """One claim: a name, what is expected, and the check."""

    name: str
    expectation: str
    check: Callable[[], Seen]


@dataclass(frozen=True)
class Case:
    """A hard case: claims about one thing at the limits."""

    name: str
    group: str
    claims: tuple[Claim, ...]


class Lit:
    """A room in a light, loaded and solved when it is first looked at. light: changes the condition of the file. sun:
    its sub-suns."""

    def __init__(
        self,
        room: Room | Callable[[], Scene],
        light: Callable[[Condition], Condition] | None = None,
        options: SolveOptions = QUICK,
        sun: Sun = 1,
    ) -> None:
        self._load = room.load if isinstance(room, Room) else room
        self._light = light or (lambda condition: condition)
        self.options = options
        self.sun = sun

    @cached_property
    def scene(self) -> Scene:
        return self._load()

    @cached_property
    def condition(self) -> Condition:
        return self._light(resolve_condition(self.scene.conditions[0], self.scene.site))

    @cached_property
    def engine(self) -> Engine:
        engine = Engine.solve(self.scene, self.options)
        engine.relight(self.condition, self.sun)
        return engine

    @cached_property
    def sensors(self) -> dict[str, Float64]:
        """Parts of the illuminance at the scene's sensors, (N, 3) each [lx]."""
        return self.measure()

    def measure(self) -> dict[str, Float64]:
        """The same, found anew."""
        points = np.concatenate([entry.points for entry in self.scene.sensors])
        normals = np.concatenate([entry.normals for entry in self.scene.sensors])
        return self.engine.illuminance(points, normals, rays=SENSOR_RAYS, opening_rays=SENSOR_OPENING_RAYS)

    def picture(self, visibility: Visibility = "rays") -> Frame:
        return self.engine.render(self.scene.views[0], visibility)

    def changed(self, change: changes.Change) -> Lit:
        """The same in a changed scene and condition."""
        return Lit(lambda: change.scene(self.scene), lambda _: change.condition(self.condition), self.options, self.sun)


def room_claims(lit: Lit, *, invariant: bool = True) -> tuple[Claim, ...]:
    """What holds of every room in every light. invariant: solve it again in every way that must not matter."""
    claims = [finite(lit), conserving(lit), methods_agree(lit), relit(lit)]
    if invariant:
        claims += [
            same(lit, changes.renamed(), 0.0, "exactly: names carry no light"),
            threads(lit),
            same(lit, changes.translated((8192.0, -16384.0, 1024.0)), ROUNDING_SHARE, "to rounding"),
            same(lit, changes.scaled(1000.0), ROUNDING_SHARE, "to rounding: light has no length"),
            same(lit, changes.reordered(), NOISE_SHARE, "to the noise of other random numbers"),
            same(lit, changes.turned(), NOISE_SHARE, "to the noise of other random numbers"),
            same(lit, changes.mirrored(), NOISE_SHARE, "to the noise of other random numbers"),
        ]
    return tuple(claims)


def finite(lit: Lit) -> Claim:
    """Sensors and both pictures hold finite numbers of at least 0."""

    def check() -> Seen:
        arrays = [*lit.sensors.values()]
        for visibility in ("rays", "volumes"):
            picture = lit.picture(visibility)
            arrays += [part.astype(np.float64) for part in (picture.radiance, *picture.components.values())]
        lowest = min(float(array.min()) for array in arrays)
        highest = max(float(array.max()) for array in arrays)
        return Seen(lowest >= 0 and math.isfinite(highest), f"values from {lowest:.4g} to {highest:.4g}")

    return Claim("finite", "illuminances and pictures are finite and not negative", check)


def conserving(lit: Lit, share: float = ENERGY_SHARE) -> Claim:
    def check() -> Seen:
        audit = lit.engine.audit()
        entered = (audit.in_sky + audit.in_beams + audit.in_reflected + audit.in_emitted).sum()
        left = (audit.absorbed + audit.out).sum()
        holds = abs(audit.imbalance) <= share if entered > 0 else left <= 1e-6
        return Seen(bool(holds), f"in {entered:.5g} lm, absorbed and out {left:.5g} lm")

    return Claim("conserves energy", f"flux in is flux absorbed and out within {100 * share:g} %", check)


def methods_agree(lit: Lit) -> Claim:
    """Shadow volumes and shadow rays show the same, away from edges."""

    def check() -> Seen:
        volumes, rays = (_image(lit.picture(visibility)) for visibility in ("volumes", "rays"))
        found = compare_methods("", "", "", volumes, rays)
        text = f"{found.away_from_edges_count} of {found.pixel_count} pixels differ away from edges"
        return Seen(found.away_from_edges_percent <= AGREEMENT_PERCENT, text)

    return Claim("two methods", f"volumes and rays differ on at most {AGREEMENT_PERCENT} % of pixels off edges", check)


def relit(lit: Lit) -> Claim:
    """An engine that has seen another light gives what one gives that has not."""

    def check() -> Seen:
        first = (
            lit.sensors["total"],
            lit.picture().radiance,
        )  # of the engine's first light, unless this is tried twice
        lit.engine.relight(changes.sunlit(lit.condition, (0.3, -0.5, 0.8)))
        lit.engine.relight(lit.condition, lit.sun)
        again = (lit.measure()["total"], lit.picture().radiance)
        differences = (again[0] - first[0], again[1] - first[1])
        largest = max(float(np.abs(difference).max()) for difference in differences)
        return Seen(largest == 0, f"largest difference {largest:.3g}")

    return Claim("relight is a fresh solve", "bit by bit the same after another light", check)


def threads(lit: Lit) -> Claim:
    def check() -> Seen:
        answers = []
        for count in (1, 3):
            with thread_limit(count):
                fresh = Lit(lambda: lit.scene, lambda _: lit.condition, lit.options, lit.sun)
                answers.append((fresh.sensors["total"], fresh.picture().radiance))
        is_same = all(np.array_equal(one, other) for one, other in zip(*answers, strict=True))
        return Seen(is_same, "1 and 3 threads: " + ("the same" if is_same else "different"))

    return Claim("other thread counts", "bit by bit the same with 1 and 3 threads", check)


def same(lit: Lit, change: changes.Change, share: float, why: str) -> Claim:
    """The changed scene has the same light, relative to the brightest sensor and the mean of the picture."""

    def check() -> Seen:
        other = lit.changed(change)
        return close(lit, other, share)

    expectation = f"the same light {why}" + (f", {100 * share:g} %" if share else "")
    return Claim(change.name, expectation, check)


def close(lit: Lit, other: Lit, share: float) -> Seen:
    """Whether two rooms have the same illuminances (relative to the brightest) and the same mean luminance."""
    ours, theirs = (luminance(entry.sensors["total"]) for entry in (lit, other))
    pictures = [float(luminance(entry.picture().radiance).mean()) for entry in (lit, other)]
    scale = max(float(ours.max()), 1e-9)
    worst = float(np.abs(ours - theirs).max()) / scale
    picture = abs(pictures[1] - pictures[0]) / max(pictures[0], 1e-9)
    text = f"sensors differ by {100 * worst:.3g} %, mean luminance by {100 * picture:.3g} %"
    return Seen(worst <= share and picture <= share, text)


def refused(name: str, act: Callable[[], object], words: Sequence[str], kind: type[Exception] = InputError) -> Claim:
    """An InputError (or another kind, for what only a program can do wrong) of one line that holds these words."""

    def check() -> Seen:
        try:
            act()
        except kind as error:
            text = str(error)
            missing = [word for word in words if word not in text]
            one_line = "\n" not in text
            return Seen(not missing and one_line, text if not missing else f"{text} (without {missing})")
        return Seen(False, "no error")

    return Claim(name, f"one clear error that says {', '.join(repr(word) for word in words)}", check)


def value(name: str, expectation: str, find: Callable[[], float], low: float, high: float) -> Claim:
    """A number that lies between bounds."""

    def check() -> Seen:
        found = find()
        return Seen(low <= found <= high, f"{found:.6g}")

    return Claim(name, expectation, check)


def _image(frame: Frame) -> ImageResult:
    return ImageResult(frame.radiance, components=frame.components)
