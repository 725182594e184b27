"""The sun's position: against the published example of its algorithm, against Radiance, and by symmetry."""

from __future__ import annotations

import math
import os
import subprocess
from datetime import datetime
from pathlib import Path

import numpy as np
import pyradiance
import pytest

from transom.daylight.sun import parse_time, sun_position
from transom.errors import InputError
from transom.scene.model import Site

RADIANCE = Path(pyradiance.__file__).parent


def test_sun_position_equals_the_published_example() -> None:
    """Reda & Andreas, NREL/TP-560-34302 (2008), appendix A.5: zenith 50.11162, azimuth 194.34024 degrees.

    The published zenith angle includes refraction at 820 mbar and 11 °C (its equation 42), taken off here.
    2e-4 degrees: the example rounds TT - UT to 67 s; the algorithm claims 3e-4.
    """
    site = Site("Golden", math.radians(39.742476), math.radians(-105.1786), -7.0, 1830.14)
    sun = sun_position(datetime(2003, 10, 17, 12, 30, 30), site)
    true_deg = math.degrees(sun.altitude_rad)
    tangent = math.tan(math.radians(true_deg + 10.3 / (true_deg + 5.11)))
    refraction_deg = (820 / 1010) * (283 / 284) * 1.02 / (60 * tangent)
    assert 90 - true_deg - refraction_deg == pytest.approx(50.11162, abs=2e-4)
    assert math.degrees(sun.azimuth_rad) == pytest.approx(194.34024, abs=2e-4)


@pytest.mark.parametrize(
    ("latitude_deg", "longitude_deg", "time_zone_h", "month", "day", "hour"),
    [
        (51.5, -0.12, 0, 3, 21, 10),
        (40.0, -105.2, -7, 6, 21, 16),
        (-33.9, 151.2, 10, 12, 21, 9),
        (1.3, 103.8, 8, 9, 23, 15),
    ],
)
def test_sun_direction_agrees_with_gensky(
    latitude_deg: float, longitude_deg: float, time_zone_h: float, month: int, day: int, hour: int
) -> None:
    """gensky -y uses Michalsky's almanac, good to 0.01 degrees and printed to 1e-6; 0.02 degrees leaves room for both.

    Radiance counts longitude and meridian west positive.
    """
    site = Site("site", math.radians(latitude_deg), math.radians(longitude_deg), time_zone_h)
    options = f"-y 2026 -a {latitude_deg} -o {-longitude_deg} -m {-15 * time_zone_h} +s"
    text = subprocess.run(
        [RADIANCE / "bin" / "gensky", str(month), str(day), str(hour), *options.split()],
        env={**os.environ, "RAYPATH": str(RADIANCE / "lib")},
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    theirs = np.array([float(word) for word in text.split()[-3:]])
    ours = sun_position(datetime(2026, month, day, hour), site).direction()
    angle_deg = math.degrees(math.acos(min(1.0, float(ours @ theirs) / float(np.linalg.norm(theirs)))))
    assert angle_deg < 0.02


def test_direction_is_east_in_the_morning_and_south_at_noon() -> None:
    site = Site("Greenwich", math.radians(51.5), 0.0, 0.0)
    morning = sun_position(datetime(2026, 3, 21, 8), site).direction()
    noon = sun_position(datetime(2026, 3, 21, 12, 7), site).direction()  # The equation of time is -7 minutes.
    assert morning[0] > 0.7
    assert noon[0] == pytest.approx(0.0, abs=0.01)
    assert noon[1] < -0.7
    assert np.linalg.norm(morning) == pytest.approx(1.0, abs=1e-12)


def test_only_the_difference_of_longitude_and_clock_matters() -> None:
    """15 degrees east on a clock one hour ahead: the same sun, but for the change of declination in one hour."""
    here = sun_position(datetime(2026, 6, 21, 10), Site("here", 0.7, 0.0, 0.0))
    there = sun_position(datetime(2026, 6, 21, 10), Site("there", 0.7, math.radians(15.0), 1.0))
    assert there.altitude_rad == pytest.approx(here.altitude_rad, abs=math.radians(0.01))
    assert there.azimuth_rad == pytest.approx(here.azimuth_rad, abs=math.radians(0.02))


@pytest.mark.parametrize("text", ["10:00", "2026-03-21", "2026-03-21T10:00+01:00", "2026-02-30T10:00", "noon"])
def test_a_bad_time_is_named_with_its_remedy(text: str) -> None:
    with pytest.raises(InputError, match=r"conditions\.a\.time = .*2026-03-21T10:00"):
        parse_time(text, "conditions.a.time")
