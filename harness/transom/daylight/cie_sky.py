"""The fifteen CIE standard general skies, and the traditional overcast sky as type 16."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from transom.daylight.sky_choice import TRADITIONAL_OVERCAST
from transom.daylight.sky_model import Floats, Formula

Float64 = NDArray[np.float64]

STANDARD_PARAMETERS: dict[int, tuple[float, float, float, float, float]] = {
    # type: (a, b) gradation from zenith to horizon, (c, d, e) scattering indicatrix
    1: (4.0, -0.70, 0.0, -1.0, 0.00),
    2: (4.0, -0.70, 2.0, -1.5, 0.15),
    3: (1.1, -0.80, 0.0, -1.0, 0.00),
    4: (1.1, -0.80, 2.0, -1.5, 0.15),
    5: (0.0, -1.00, 0.0, -1.0, 0.00),
    6: (0.0, -1.00, 2.0, -1.5, 0.15),
    7: (0.0, -1.00, 5.0, -2.5, 0.30),
    8: (0.0, -1.00, 10.0, -3.0, 0.45),
    9: (-1.0, -0.55, 2.0, -1.5, 0.15),
    10: (-1.0, -0.55, 5.0, -2.5, 0.30),
    11: (-1.0, -0.55, 10.0, -3.0, 0.45),
    12: (-1.0, -0.32, 10.0, -3.0, 0.45),
    13: (-1.0, -0.32, 16.0, -3.0, 0.30),
    14: (-1.0, -0.15, 16.0, -3.0, 0.30),
    15: (-1.0, -0.15, 24.0, -2.8, 0.15),
}
"""CIE S 011/E:2003 (ISO 15469:2004), Table 1."""

SMALLEST_SINE = 1e-6  # exp(b / sin(altitude)) has reached its limit at the horizon, 0, long before.


@dataclass(frozen=True)
class CieSky:
    """Relative luminance of CIE general sky `type` (1 to 15), or the traditional overcast sky (16)."""

    type: int

    @property
    def depends_on_sun(self) -> bool:
        """False where the luminance is the same for every position of the sun: types 1, 3, 5 and 16."""
        return self.type in STANDARD_PARAMETERS and STANDARD_PARAMETERS[self.type][2] != 0

    def relative_luminance(self, sin_altitude: Floats, cos_sun_angle: Floats) -> Floats:
        """phi(Z) f(chi) of the standard, without a unit, at altitudes above 0 (equal shapes in and out).

        phi(Z) = 1 + a exp(b / cos Z);  f(chi) = 1 + c (exp(d chi) - exp(d pi/2)) + e cos² chi
        [CIE S 011, equations 2 and 4]; traditional overcast: (1 + 2 cos Z) / 3 [Moon & Spencer 1942].
        """
        if self.type == TRADITIONAL_OVERCAST:
            return (1 + 2 * sin_altitude) / 3
        a, b, c, d, e = STANDARD_PARAMETERS[self.type]
        gradation = 1 + a * np.exp(b / np.maximum(sin_altitude, SMALLEST_SINE))
        if not self.depends_on_sun:
            return gradation
        cosine = np.clip(cos_sun_angle, -1.0, 1.0)
        result: Floats = gradation * (
            1 + c * (np.exp(d * np.arccos(cosine)) - math.exp(d * math.pi / 2)) + e * cosine**2
        )
        return result

    def formula(self) -> Formula | None:
        """a, b, c, d, e of the standard, and k = 1 - c exp(d pi/2); None: the traditional overcast sky has another."""
        if self.type == TRADITIONAL_OVERCAST:
            return None
        a, b, c, d, e = STANDARD_PARAMETERS[self.type]
        return a, b, c, d, e, 1 - c * math.exp(d * math.pi / 2)
