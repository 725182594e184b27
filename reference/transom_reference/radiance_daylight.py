"""Sun, sky and ground for Radiance: the very same sky function, as a function file of our own.

Radiance's sky programs blend the ground into the sky near the horizon and print four digits; this file has neither.
Light crosses one border here: our photometric RGB (Rec. 709, lx or cd/m²) is divided by 179 lm/W on the way in
(`watts`) and multiplied on the way out (`lumens`). Radiance carries three numbers and multiplies channel by channel,
so that what they are called is settled at this border: they are Rec. 709 throughout. Converting reflectances to
Radiance's own primaries would change products of colours, and an agreement with it would be one of primaries.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from transom.daylight.cie_sky import STANDARD_PARAMETERS, CieSky
from transom.daylight.condition import Condition
from transom.daylight.perez_sky import PerezSky
from transom.daylight.sun_disc import SUN_DIAMETER_DEG
from transom.errors import InputError

Float64 = NDArray[np.float64]

WHITE_EFFICACY_LM_W = 179.0
"""Radiance's fixed luminous efficacy of equal-energy white: luminance over radiance. [Ward 1994, WHTEFFICACY]"""

POINT_SUN_DIAMETER_DEG = 0.01
"""A disc that is a point for every purpose, for the matched sun: its penumbra is 0.2 mm wide at 1 m."""

SKY_FILE = "daylight.cal"

SKY_FUNCTIONS = """{ Luminance of the CIE general skies, the traditional overcast sky and the Perez sky, and ground.
  arg(1) level; arg(2..6) a b c d e; arg(7..9) towards the sun; arg(10..12) sky colour; arg(13..15) ground. }
sky_sine = if(Dz - 1e-6, Dz, 1e-6);
sky_between(low, value, high) = if(value - high, high, if(low - value, low, value));
sky_cosine = sky_between(-1, Dx*arg(7) + Dy*arg(8) + Dz*arg(9), 1);
sky_angle = acos(sky_cosine);
sky_gradation = 1 + arg(2)*exp(arg(3)/sky_sine);
general_sky = arg(1)*sky_gradation*
    (1 + arg(4)*(exp(arg(5)*sky_angle) - exp(arg(5)*PI/2)) + arg(6)*sky_cosine*sky_cosine);
overcast_sky = arg(1)*(1 + 2*Dz)/3;
perez_formula = arg(1)*sky_gradation*(1 + arg(4)*exp(arg(5)*sky_angle) + arg(6)*sky_cosine*sky_cosine);
perez_sky = if(perez_formula, perez_formula, 0);
general_red = if(Dz, general_sky*arg(10), arg(13));
general_green = if(Dz, general_sky*arg(11), arg(14));
general_blue = if(Dz, general_sky*arg(12), arg(15));
overcast_red = if(Dz, overcast_sky*arg(10), arg(13));
overcast_green = if(Dz, overcast_sky*arg(11), arg(14));
overcast_blue = if(Dz, overcast_sky*arg(12), arg(15));
perez_red = if(Dz, perez_sky*arg(10), arg(13));
perez_green = if(Dz, perez_sky*arg(11), arg(14));
perez_blue = if(Dz, perez_sky*arg(12), arg(15));
"""


def watts(photometric: ArrayLike) -> Float64:
    """Radiance's W/m² or W/(m² sr) of our lx or cd/m², any shape, same channels."""
    return np.asarray(photometric, dtype=np.float64) / WHITE_EFFICACY_LM_W


def lumens(radiometric: ArrayLike) -> Float64:
    """Our lx or cd/m² of Radiance's W/m² or W/(m² sr), any shape, same channels."""
    return np.asarray(radiometric, dtype=np.float64) * WHITE_EFFICACY_LM_W


def daylight_description(condition: Condition, *, full_physics: bool) -> str:
    """The sun, and sky and ground as one pattern `daylight` over the whole sphere, as Radiance scene text."""
    text = [_pattern(condition)]
    if condition.sun_direction is not None and float(np.max(condition.sun_illuminance_rgb)) > 0:
        diameter_deg = SUN_DIAMETER_DEG if full_physics else POINT_SUN_DIAMETER_DEG
        # Illuminance across the beam = radiance x pi sin²(radius) for a uniform disc.
        spread = math.pi * math.sin(math.radians(diameter_deg) / 2) ** 2
        text += [
            f"void light sun_light\n0\n0\n3 {numbers(watts(condition.sun_illuminance_rgb) / spread)}",
            f"sun_light source sun\n0\n0\n4 {numbers(condition.sun_direction)} {diameter_deg}",
        ]
    text += ["daylight glow sphere_glow\n0\n0\n4 1 1 1 0", "sphere_glow source sphere\n0\n0\n4 0 0 1 360"]
    return "\n".join(text) + "\n"


def numbers(values: ArrayLike) -> str:
    """Numbers for a scene description, to the last digit."""
    return " ".join(f"{float(value):.17g}" for value in np.asarray(values, dtype=np.float64).ravel())


def _pattern(condition: Condition) -> str:
    sky = condition.sky
    name, parameters = _formula(sky.pattern)
    level = float(watts(sky.scale))
    values = [level, *parameters, *sky.sun_direction, *condition.sky_rgb, *watts(condition.ground_luminance_rgb)]
    names = " ".join(f"{name}_{colour}" for colour in ("red", "green", "blue"))
    return f"void colorfunc daylight\n4 {names} {SKY_FILE}\n0\n{len(values)} {numbers(values)}"


def _formula(pattern: object) -> tuple[str, Sequence[float]]:
    """Name of the function in SKY_FUNCTIONS, and a..e."""
    if isinstance(pattern, PerezSky):
        return "perez", pattern.parameters
    if isinstance(pattern, CieSky):
        if pattern.type in STANDARD_PARAMETERS:
            return "general", STANDARD_PARAMETERS[pattern.type]
        return "overcast", (0.0,) * 5
    raise InputError(
        "is a sky that Radiance has no function for here",
        field="sky",
        value=type(pattern).__name__,
        remedy="Use a CIE or a Perez sky",
    )
