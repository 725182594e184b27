"""The Perez all-weather sky: relative luminance and luminous efficacies from direct and diffuse irradiance.

R. Perez, R. Seals, J. Michalsky, "All-weather model for sky luminance distribution", Solar Energy 50(3), 1993;
R. Perez et al., "Modeling daylight availability and irradiance components", Solar Energy 44(5), 1990.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from transom.daylight.cie_sky import SMALLEST_SINE
from transom.daylight.sky_model import Floats, Formula
from transom.errors import InputError

Float64 = NDArray[np.float64]
Parameters = tuple[float, float, float, float, float]

SOLAR_CONSTANT_W_M2 = 1367.0
DEW_POINT_C = 10.97353115  # Gives 2 cm of precipitable water, the default of Perez's efficacies and of gendaylit.
CLEARNESS_LIMITS = (1.0, 12.01 - 0.001)
BRIGHTNESS_LIMITS = (0.01, 0.6)
CLEARNESS_BINS = (1.065, 1.230, 1.500, 1.950, 2.800, 4.500, 6.200)

COEFFICIENTS: Float64 = np.array(
    # One row for each bin of clearness: a1..a4, b1..b4, c1..c4, d1..d4, e1..e4. [Perez 1993, Table 1]
    [
        [1.3525, -0.2576, -0.2690, -1.4366, -0.7670, 0.0007, 1.2734, -0.1233, 2.8000, 0.6004, 1.2375, 1.0000,
         1.8734, 0.6297, 0.9738, 0.2809, 0.0356, -0.1246, -0.5718, 0.9938],
        [-1.2219, -0.7730, 1.4148, 1.1016, -0.2054, 0.0367, -3.9128, 0.9156, 6.9750, 0.1774, 6.4477, -0.1239,
         -1.5798, -0.5081, -1.7812, 0.1080, 0.2624, 0.0672, -0.2190, -0.4285],
        [-1.1000, -0.2515, 0.8952, 0.0156, 0.2782, -0.1812, -4.5000, 1.1766, 24.7219, -13.0812, -37.7000, 34.8438,
         -5.0000, 1.5218, 3.9229, -2.6204, -0.0156, 0.1597, 0.4199, -0.5562],
        [-0.5484, -0.6654, -0.2672, 0.7117, 0.7234, -0.6219, -5.6812, 2.6297, 33.3389, -18.3000, -62.2500, 52.0781,
         -3.5000, 0.0016, 1.1477, 0.1062, 0.4659, -0.3296, -0.0876, -0.0329],
        [-0.6000, -0.3566, -2.5000, 2.3250, 0.2937, 0.0496, -5.6812, 1.8415, 21.0000, -4.7656, -21.5906, 7.2492,
         -3.5000, -0.1554, 1.4062, 0.3988, 0.0032, 0.0766, -0.0656, -0.1294],
        [-1.0156, -0.3670, 1.0078, 1.4051, 0.2875, -0.5328, -3.8500, 3.3750, 14.0000, -0.9999, -7.1406, 7.5469,
         -3.4000, -0.1078, -1.0750, 1.5702, -0.0672, 0.4016, 0.3017, -0.4844],
        [-1.0000, 0.0211, 0.5025, -0.5119, -0.3000, 0.1922, 0.7023, -1.6317, 19.0000, -5.0000, 1.2438, -1.9094,
         -4.0000, 0.0250, 0.3844, 0.2656, 1.0468, -0.3788, -2.4517, 1.4656],
        [-1.0500, 0.0289, 0.4260, 0.3590, -0.3250, 0.1156, 0.7781, 0.0025, 31.0625, -14.5000, -46.1148, 55.3750,
         -7.2312, 0.4050, 13.3500, 0.6234, 1.5000, -0.6426, 1.8564, 0.5636],
    ]
).reshape(8, 5, 4)  # fmt: skip

DIFFUSE_EFFICACY: Float64 = np.array(
    # One row for each bin of clearness: a, b, c, d [lm/W]. [Perez 1990, Table 4]
    [
        [97.24, -0.46, 12.00, -8.91],
        [107.22, 1.15, 0.59, -3.95],
        [104.97, 2.96, -5.53, -8.77],
        [102.39, 5.59, -13.95, -13.90],
        [100.71, 5.94, -22.75, -23.74],
        [106.42, 3.83, -36.15, -28.83],
        [141.88, 1.90, -53.24, -14.03],
        [152.23, 0.35, -45.27, -7.98],
    ]
)
DIRECT_EFFICACY: Float64 = np.array(
    [
        [57.20, -4.55, -2.98, 117.12],
        [98.99, -3.46, -1.21, 12.38],
        [109.83, -4.90, -1.71, -8.81],
        [110.34, -5.84, -1.99, -4.56],
        [106.36, -3.97, -1.75, -6.16],
        [107.19, -1.25, -1.51, -26.73],
        [105.75, 0.77, -1.26, -34.44],
        [101.18, 1.58, -1.10, -8.29],
    ]
)


@dataclass(frozen=True)
class PerezSky:
    """Relative luminance for the five parameters a..e; negative values of the formula count as 0."""

    parameters: Parameters
    depends_on_sun = True

    def relative_luminance(self, sin_altitude: Floats, cos_sun_angle: Floats) -> Floats:
        """(1 + a exp(b / cos zeta)) (1 + c exp(d gamma) + e cos² gamma), no unit, at altitudes above 0. [Perez 1993]"""
        a, b, c, d, e = self.parameters
        cosine = np.clip(cos_sun_angle, -1.0, 1.0)
        gradation = 1 + a * np.exp(b / np.maximum(sin_altitude, SMALLEST_SINE))
        indicatrix = 1 + c * np.exp(d * np.arccos(cosine)) + e * cosine**2
        result: Floats = np.maximum(gradation * indicatrix, 0.0)
        return result

    def formula(self) -> Formula | None:
        """Its parameters; k = 1."""
        return *self.parameters, 1.0


def clearness_and_brightness(
    direct_normal_w_m2: float, diffuse_horizontal_w_m2: float, zenith_angle_rad: float, day_of_year: int
) -> tuple[float, float]:
    """Perez's epsilon and Delta, clamped to the range of the model as gendaylit clamps them.

    epsilon = ((Ed + Es) / Ed + 1.041 Z³) / (1 + 1.041 Z³);  Delta = m Ed / E0, with the air mass m of Kasten (1966) and
    the solar constant at the earth's distance E0 (Spencer 1971).
    """
    cubed = 1.041 * zenith_angle_rad**3
    clearness = ((diffuse_horizontal_w_m2 + direct_normal_w_m2) / diffuse_horizontal_w_m2 + cubed) / (1 + cubed)
    air_mass = 1 / (math.cos(zenith_angle_rad) + 0.15 * (93.885 - math.degrees(zenith_angle_rad)) ** -1.253)
    brightness = diffuse_horizontal_w_m2 * air_mass / (SOLAR_CONSTANT_W_M2 * distance_factor(day_of_year))
    return (
        min(max(clearness, CLEARNESS_LIMITS[0]), CLEARNESS_LIMITS[1]),
        min(max(brightness, BRIGHTNESS_LIMITS[0]), BRIGHTNESS_LIMITS[1]),
    )


def distance_factor(day_of_year: int) -> float:
    """(mean / actual distance of the sun)², the factor on the solar constant. [Spencer 1971]"""
    day = 2 * math.pi * (day_of_year - 1) / 365
    return (
        1.00011
        + 0.034221 * math.cos(day)
        + 0.00128 * math.sin(day)
        + 0.000719 * math.cos(2 * day)
        + 0.000077 * math.sin(2 * day)
    )


def perez_sky(clearness: float, brightness: float, zenith_angle_rad: float, field: str = "sky") -> PerezSky:
    """The sky of that clearness epsilon, brightness Delta and solar zenith angle Z [rad].

    x = x1 + x2 Z + Delta (x3 + x4 Z) for each of a..e, with Perez's own form of c and d in the first bin; Delta is at
    least 0.2 for 1.065 < epsilon < 2.8, as in gendaylit. Raises InputError, naming `field`, where b would be positive,
    since the luminance would then grow without bound towards the horizon.
    """
    if 1.065 < clearness < 2.8:
        brightness = max(brightness, 0.2)
    row = _clearness_bin(clearness)
    x = COEFFICIENTS[row]
    a, b, c, d, e = (
        x[:, 0] + x[:, 1] * zenith_angle_rad + brightness * (x[:, 2] + x[:, 3] * zenith_angle_rad)
    ).tolist()
    if row == 0:
        c = math.exp((brightness * (x[2, 0] + x[2, 1] * zenith_angle_rad)) ** x[2, 2]) - x[2, 3]
        d = -math.exp(brightness * (x[3, 0] + x[3, 1] * zenith_angle_rad)) + x[3, 2] + brightness * x[3, 3]
    if b > 0:
        raise InputError(
            f"gives the Perez sky no meaning here (clearness {clearness:.3f}, brightness {brightness:.3f}, "
            f"sun at {90 - math.degrees(zenith_angle_rad):.1f} degrees: the parameter b = {b:.3f} is positive)",
            field=field,
            remedy="Check DNI and DHI, or choose a CIE sky",
        )
    return PerezSky((a, b, float(c), float(d), e))


def luminous_efficacies(clearness: float, brightness: float, zenith_angle_rad: float) -> tuple[float, float]:
    """Luminous efficacy [lm/W] of direct normal and diffuse horizontal irradiance. [Perez 1990, eq. 7 and 8]"""
    row, water_cm = _clearness_bin(clearness), math.exp(0.07 * DEW_POINT_C - 0.075)
    a, b, c, d = DIRECT_EFFICACY[row]
    direct = a + b * water_cm + c * math.exp(5.73 * zenith_angle_rad - 5) + d * brightness
    a, b, c, d = DIFFUSE_EFFICACY[row]
    diffuse = a + b * water_cm + c * math.cos(zenith_angle_rad) + d * math.log(brightness)
    return max(float(direct), 0.0), max(float(diffuse), 0.0)


def _clearness_bin(clearness: float) -> int:
    return int(np.searchsorted(CLEARNESS_BINS, clearness, side="right"))
