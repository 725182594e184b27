"""Where the sun stands: the NREL solar position algorithm (Reda & Andreas 2004) through pvlib."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import numpy as np
from numpy.typing import NDArray

from transom.errors import InputError
from transom.scene.model import Site

STANDARD_PRESSURE_MBAR = 1013.25
STANDARD_TEMPERATURE_C = 12.0
STANDARD_REFRACTION_DEG = 0.5667  # At sunrise; used by the algorithm only to choose when refraction applies.


@dataclass(frozen=True)
class SunPosition:
    """The sun's centre. altitude_rad: negative below the horizon. azimuth_rad: clockwise from north, 0 to 2 pi."""

    altitude_rad: float
    azimuth_rad: float

    def direction(self) -> NDArray[np.float64]:
        """Unit vector (3,) towards the sun: x east, y north, z up."""
        across = math.cos(self.altitude_rad)
        return np.array(
            [across * math.sin(self.azimuth_rad), across * math.cos(self.azimuth_rad), math.sin(self.altitude_rad)]
        )


def parse_time(text: str, field: str = "time") -> datetime:
    """Civil standard time as "2026-03-21T10:00", without an offset. Raises InputError, naming `field`, otherwise."""
    try:
        time = datetime.fromisoformat(text)
    except ValueError:
        raise InputError(
            "is not a time", field=field, value=text, remedy='Write date and clock time as "2026-03-21T10:00"'
        ) from None
    if time.tzinfo is not None or len(text) <= len("2026-03-21"):
        raise InputError(
            "must be a date and a clock time without an offset",
            field=field,
            value=text,
            remedy='Write the site\'s standard time (no daylight saving) as "2026-03-21T10:00"',
        )
    return time


def sun_position(time: datetime, site: Site) -> SunPosition:
    """True (geometric) position of the sun's centre; atmospheric refraction is left out.

    time: civil standard time at `site` (UTC + site.time_zone_h, no daylight saving), without tzinfo.
    The CIE and Perez skies are defined by the geometric altitude, and other daylight programs use it. Refraction lifts
    the sun by 0.5 degrees at the horizon, 0.1 degrees at 8 and 0.02 at 45 degrees of altitude.
    The algorithm is good to 0.0003 degrees for the years -2000 to 6000.
    """
    from pvlib import spa  # Brings pandas with it: imported by those who need the sun only.

    utc = (time - timedelta(hours=site.time_zone_h)).replace(tzinfo=UTC)
    result = spa.solar_position_numpy(
        np.array([utc.timestamp()]),
        math.degrees(site.latitude_rad),
        math.degrees(site.longitude_rad),
        site.elevation_m,
        STANDARD_PRESSURE_MBAR,
        STANDARD_TEMPERATURE_C,
        spa.calculate_deltat(utc.year, utc.month),
        STANDARD_REFRACTION_DEG,
        1,
    )
    _, _, _, true_elevation_deg, azimuth_deg, _ = (float(row[0]) for row in result)
    return SunPosition(math.radians(true_elevation_deg), math.radians(azimuth_deg))
