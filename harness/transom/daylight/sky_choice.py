"""The short names of skies, as written in scene.toml and after `--sky`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from transom.errors import InputError

TRADITIONAL_OVERCAST = 16
ALIASES = {"clear": "cie:12", "overcast": "cie:1", "uniform": "cie:5"}
SKY_FORMS = 'Use "cie:1" to "cie:16", "clear", "overcast", "uniform", "perez:DNI,DHI" in W/m², or "none"'


@dataclass(frozen=True)
class SkyChoice:
    """Which sky: cie_type 1..16 for "cie" (16: traditional overcast); irradiances [W/m²] for "perez"."""

    kind: Literal["cie", "perez", "none"]
    cie_type: int = 0
    direct_normal_w_m2: float = 0.0
    diffuse_horizontal_w_m2: float = 0.0


def parse_sky(text: str, field: str = "sky") -> SkyChoice:
    """The sky that `text` names. Raises InputError, naming `field`, if it is unknown or has impossible irradiances."""
    kind, _, arguments = ALIASES.get(text, text).partition(":")
    if text == "none":
        return SkyChoice("none")
    if kind == "cie":
        if not arguments.isdecimal() or not 1 <= int(arguments) <= TRADITIONAL_OVERCAST:
            raise InputError("is not a CIE sky type 1 to 16", field=field, value=text, remedy=SKY_FORMS)
        return SkyChoice("cie", cie_type=int(arguments))
    if kind == "perez":
        direct, diffuse = _irradiances(text, arguments, field)
        return SkyChoice("perez", direct_normal_w_m2=direct, diffuse_horizontal_w_m2=diffuse)
    raise InputError("is not a sky", field=field, value=text, remedy=SKY_FORMS)


def _irradiances(text: str, arguments: str, field: str) -> tuple[float, float]:
    try:
        direct, diffuse = (float(part) for part in arguments.split(","))
    except ValueError:
        raise InputError("needs two irradiances", field=field, value=text, remedy=SKY_FORMS) from None
    if not (math.isfinite(direct) and math.isfinite(diffuse)) or not 0 <= direct <= 1367 or not 0 <= diffuse <= 1367:
        raise InputError(
            "has an irradiance outside 0 to 1367 W/m² (the solar constant)", field=field, value=text, remedy=SKY_FORMS
        )
    if diffuse == 0:
        raise InputError(
            "has no diffuse irradiance, for which the Perez sky is not defined",
            field=field,
            value=text,
            remedy="Give DHI above 0, or a sky of another kind with diffuse_horizontal_illuminance_lx = 0",
        )
    return direct, diffuse
