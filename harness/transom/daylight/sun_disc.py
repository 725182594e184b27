"""The sun's disc as sub-suns: beams that each stand for an equal part of it, and how many a scene asks for.

The disc is uniform: that it darkens towards its limb is left out, as in the references' full physics.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from transom.errors import InputError

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Sun = int | Literal["auto"]
Shares = Callable[[Float64, NDArray[np.intp]], Float32]

SUN_DIAMETER_DEG = 0.533
"""Mean apparent diameter of the sun, as Radiance has it."""

SUN_RADIUS_RAD = math.radians(SUN_DIAMETER_DEG / 2)

RING_TURN_RAD = math.radians(11.0)
"""Each ring of sub-suns is turned by so much against the one within it: of all multiples of a degree the one whose
penumbras of straight edges and slits, over all their orientations, err least with 19, 37 and 61."""

COUNTS = (1, 7, 19, 37, 61, 91, 127)
"""Numbers of sub-suns that fill rings: 1 in the middle, 6, 12, 18 .. around it."""

DISC_COUNT = 19
"""Sub-suns of "disc" where no number is said: a penumbra's illuminance is then within 0.1 of the full sun's."""

SUN_FORMS = f'Use "point", "auto", "disc", or "disc:N" with N = {", ".join(map(str, COUNTS[1:]))}'

FIRST_PROBES, PROBES = 19, 127
"""Sub-suns that places are asked for to find those that the sun reaches, and to know what these see of the disc."""

MOST_PLACES = 8000
"""Most places that are asked: of a hall of 30,000 patches as many as of a room of 8,000."""

PARTIAL = 0.1
"""Of the most that a place sees of any part of the disc: less of a difference is no edge (panes dim by the angle)."""

AUTO_COUNTS = (1, 7, 19, 37)
"""Numbers that "auto" chooses from: light and shade that 37 do not tell apart are finer than pixels."""

TOLERANCE = 0.1
"""Mean error of the sun's illuminance at places, relative to its mean, that "auto" allows. Of a point it is 0.01 to
0.08 behind the windows of the four rooms, 0.1 to 0.5 behind louvres."""


def parse_sun(text: str, field: str = "sun") -> Sun:
    """Number of sub-suns that `text` names, or "auto". Raises InputError, naming `field`, otherwise."""
    if text == "auto":
        return "auto"
    if text == "point":
        return 1
    kind, separator, number = text.partition(":")
    if kind == "disc" and not separator:
        return DISC_COUNT
    if kind == "disc" and number.isdecimal() and int(number) in COUNTS[1:]:
        return int(number)
    raise InputError("is not a form of the sun", field=field, value=text, remedy=SUN_FORMS)


def sub_suns(direction: Float64, count: int) -> Float64:
    """Unit directions (count, 3) of sub-suns around the sun's (3,); their mean has its direction.

    Rings of 6, 12, 18 .. about one in the middle, each ring at the radius that halves its part of the disc's solid
    angle. The pattern hangs from the vertical plane through the sun, so that it turns about the zenith with the scene.
    Raises InputError for a count that does not fill rings.
    """
    if count not in COUNTS:
        raise InputError("does not fill rings about the sun", field="sub_suns", value=count, remedy=SUN_FORMS)
    share, turn = [0.0], [0.0]
    for ring in range(1, COUNTS.index(count) + 1):
        within, up_to = COUNTS[ring - 1], COUNTS[ring]
        share += [(within + up_to) / 2 / count] * (6 * ring)
        turn += [ring * RING_TURN_RAD + 2 * math.pi * k / (6 * ring) for k in range(6 * ring)]
    return _on_disc(direction, np.array(share), np.array(turn))


def sub_sun_illuminance(illuminance: Float64, count: int) -> Float64:
    """Normal illuminance of each sub-sun where that of the sun is `illuminance` [lx], same shape.

    The surface that faces the sun's middle receives exactly the sun's light, and so does every surface that sees the
    whole disc, since directions times illuminances add up to those of the sun.
    """
    north = np.array([0.0, 1.0, 0.0])
    mean_cosine = float((sub_suns(north, count) @ north).mean())
    return illuminance / (count * mean_cosine)


@dataclass(frozen=True)
class SunPlan:
    """Sub-suns of a condition, and why so many.

    penumbra_share: of the sun's light on surfaces of rooms, what falls on places that see a part of the disc.
    point_sun_error, sub_sun_error: of its illuminance at places, in the mean and relative to its mean, with a point and
    with these sub-suns. All three are 0 where nobody asked, or no sun comes in.
    """

    sub_suns: int = 1
    penumbra_share: float = 0.0
    point_sun_error: float = 0.0
    sub_sun_error: float = 0.0

    def facts(self) -> dict[str, float]:
        """For the run bundle."""
        return asdict(self)


def plan_sun(direction: Float64, shares: Shares, weights: Float32) -> SunPlan:
    """The least number of sub-suns that a scene asks for under a sun in a unit direction (3,).

    shares: of light from directions (D, 3), what arrives at places of some numbers (K,) as (K, D). weights (P,): flux
    of 1 lx on what each of all places stands for. A point is enough where penumbras, a hundredth as wide as light's way
    from what casts them, are narrow beside what is lit; behind louvres with gaps of a few penumbras it is not.
    """
    asked = np.arange(0, len(weights), -(-len(weights) // MOST_PLACES) or 1)
    lit = asked[shares(sub_suns(direction, FIRST_PROBES), asked).any(axis=1)]
    seen = shares(sub_suns(direction, PROBES), lit).astype(np.float64)
    mean, weights = seen.mean(axis=1), weights[lit]
    total = float(weights @ mean)
    if total <= 0:
        return SunPlan()
    partly = np.ptp(seen, axis=1) > PARTIAL * seen.max(axis=1)
    errors: list[float] = []
    for count in AUTO_COUNTS:
        found = shares(sub_suns(direction, count), lit).astype(np.float64).mean(axis=1)
        errors.append(float(weights @ np.abs(found - mean)) / total)
        if errors[-1] <= TOLERANCE:
            break
    return SunPlan(count, float(weights[partly] @ mean[partly]) / total, errors[0], errors[-1])


def _on_disc(direction: Float64, share: Float64, turn: Float64) -> Float64:
    """Unit directions (N, 3) about a unit direction: share of the disc's solid angle within, turn about its middle."""
    right = np.array([-direction[1], direction[0], 0.0])
    length = float(np.linalg.norm(right))
    right = right / length if length > 1e-9 else np.array([1.0, 0.0, 0.0])
    up = np.cross(direction, right)
    half_sine = np.sqrt(share) * math.sin(SUN_RADIUS_RAD / 2)  # of the angle from the middle
    sine = 2 * half_sine * np.sqrt(1 - half_sine**2)
    beside = np.cos(turn)[:, None] * right + np.sin(turn)[:, None] * up
    found: Float64 = (1 - 2 * half_sine**2)[:, None] * direction + sine[:, None] * beside
    return found
