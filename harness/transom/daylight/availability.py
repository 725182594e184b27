"""The IES daylight availability model: mean direct and diffuse illuminance for a sun altitude and a kind of sky.

"Recommended practice for the calculation of daylight availability", Journal of the IES 13(4), 381-392, 1984 (RP-21).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

SOLAR_ILLUMINANCE_CONSTANT_LX = 128_000.0


@dataclass(frozen=True)
class KindOfSky:
    """extinction: c of the beam, None where no sun shines; offset, gain [lx] and exponent: A, B, C of the diffuse."""

    extinction: float | None
    offset_lx: float
    gain_lx: float
    exponent: float


CLEAR = KindOfSky(0.21, 800.0, 15_500.0, 0.5)
PARTLY_CLOUDY = KindOfSky(0.80, 300.0, 45_000.0, 1.0)
OVERCAST = KindOfSky(None, 300.0, 21_000.0, 1.0)


def kind_of_cie_sky(cie_type: int) -> KindOfSky:
    """Overcast for types 1 to 5 and 16, partly cloudy for 6 to 10, clear for 11 to 15 (Kittler & Darula's groups)."""
    if cie_type <= 5 or cie_type == 16:
        return OVERCAST
    return PARTLY_CLOUDY if cie_type <= 10 else CLEAR


def direct_normal_illuminance(kind: KindOfSky, sun_altitude_rad: float, day_of_year: int) -> float:
    """E_dn = E_xt exp(-c / sin(altitude)) [lx]; 0 when the sun is not above the horizon.

    E_xt = 128 klx (1 + 0.034 cos(2 pi (J - 2) / 365)) at day J of the year.
    """
    if kind.extinction is None or sun_altitude_rad <= 0:
        return 0.0
    extraterrestrial = SOLAR_ILLUMINANCE_CONSTANT_LX * (1 + 0.034 * math.cos(2 * math.pi * (day_of_year - 2) / 365))
    return extraterrestrial * math.exp(-kind.extinction / math.sin(sun_altitude_rad))


def diffuse_horizontal_illuminance(kind: KindOfSky, sun_altitude_rad: float) -> float:
    """E_dh = A + B sin(altitude)^C [lx]; 0 when the sun is not above the horizon."""
    if sun_altitude_rad <= 0:
        return 0.0
    return kind.offset_lx + kind.gain_lx * math.pow(math.sin(sun_altitude_rad), kind.exponent)
