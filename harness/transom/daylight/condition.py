"""A condition: one sky, sun and ground at one place and time, resolved to numbers that every renderer shares."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from transom.colour import rgb_of_temperature
from transom.daylight import availability, perez_sky
from transom.daylight.cie_sky import CieSky
from transom.daylight.environment import environment_image
from transom.daylight.sky_bins import SkyBins
from transom.daylight.sky_choice import SkyChoice, parse_sky
from transom.daylight.sky_model import (
    Floats,
    SkyModel,
    SkyPattern,
    relative_horizontal_illuminance,
    relative_zenith_luminance,
)
from transom.daylight.sun import SunPosition, parse_time, sun_position
from transom.errors import InputError
from transom.scene.model import ConditionSpec, Site

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

KEY_DIGITS = 9  # Of the numbers in a key: fewer than differ between machines, more than any light depends on.


@dataclass(frozen=True, eq=False)
class Condition:
    """Sky, sun and ground as light. RGB is linear Rec. 709, whose Y carries the photometric quantity.

    name, spec: as written. sun: position of the sun's centre, above the horizon or below.
    sun_direction: unit vector (3,) towards the sun, or None when there is no beam (none given, or sun not up).
    sun_illuminance_rgb (3,): illuminance normal to the beam [lx]; zeros without one.
    sky: luminance(directions (N, 3)) -> (N,) [cd/m²], 0 below the horizon. sky_rgb (3,): its colour, Y = 1.
    ground_luminance_rgb (3,): albedo x (sun + sky on the horizontal) / pi [cd/m²], sun and sky with their own colours.
    diffuse_horizontal_lx, direct_normal_lx: the levels that all of the above have.
    """

    name: str
    spec: ConditionSpec
    sun: SunPosition
    sun_direction: Float64 | None
    sun_illuminance_rgb: Float64
    sky: SkyModel
    sky_rgb: Float64
    ground_luminance_rgb: Float64
    diffuse_horizontal_lx: float
    direct_normal_lx: float

    def key(self) -> str:
        """SHA-256 (hex) of the light itself: conditions with equal keys light a scene alike, whatever their names."""
        pattern = {"model": type(self.sky.pattern).__name__, **vars(self.sky.pattern)} if self.sky.scale > 0 else None
        around = self.sky.sun_direction if pattern and self.sky.pattern.depends_on_sun else None
        content = {
            "sky": pattern,
            "sky_scale": self.sky.scale,
            "sky_sun": around,
            "sky_rgb": self.sky_rgb,
            "sun": self.sun_direction,
            "sun_rgb": self.sun_illuminance_rgb,
            "ground_rgb": self.ground_luminance_rgb,
        }
        return hashlib.sha256(json.dumps(_rounded(content), sort_keys=True).encode()).hexdigest()

    def bin_luminance(self, bins: SkyBins) -> Floats:
        """Mean luminance of the sky over each bin's solid angle (bins.count,) [cd/m²]; the sun's disc is not in it."""
        return bins.mean(self.sky.luminance, np.array(self.sky.sun_direction))

    def environment_image(self, height: int) -> Float32:
        """Sky and ground as a latitude-longitude image (height, 2 height, 3) [cd/m²], without the sun.

        Row 0 is the zenith; row j lies at pi j / (height - 1) from it, column i at azimuth 2 pi (i + 1/2) / (2 height)
        from +x (east) towards +y (north).
        """
        return environment_image(self.sky, self.sky_rgb, self.ground_luminance_rgb, height)


def resolve_condition(spec: ConditionSpec, site: Site) -> Condition:
    """The condition that `spec` describes at `site`.

    Levels: given ones are kept; otherwise a Perez sky's come from its irradiances by Perez's luminous efficacies, and a
    CIE sky's from the IES availability model. Colour temperatures change chromaticity only, never luminance.
    With the sun at or below the horizon there is no beam, and the sky is dark, except an overcast or uniform sky
    (cie:1, 3, 5, 16, which know no sun) whose level is given. Sky "none": no sky, no sun, black ground.
    Raises InputError for contradictory or impossible values, among them light given for a sun that has set.
    """
    choice = _checked_choice(spec)
    time = parse_time(spec.time, _name(spec, "time"))
    position = sun_position(time, site)
    sun_is_up = position.altitude_rad > 0
    _check_levels(spec, choice, position)

    pattern, default_direct_lx, default_diffuse_lx = _pattern_and_default_levels(spec, choice, position, time)
    direct_lx = default_direct_lx if spec.direct_normal_illuminance_lx is None else spec.direct_normal_illuminance_lx
    altitude = position.altitude_rad
    if spec.zenith_luminance_cd_m2 is not None:
        scale = spec.zenith_luminance_cd_m2 / _zenith_value(spec, pattern, altitude)
    else:
        diffuse_lx = spec.diffuse_horizontal_illuminance_lx
        diffuse_lx = default_diffuse_lx if diffuse_lx is None else diffuse_lx
        scale = diffuse_lx / relative_horizontal_illuminance(pattern, altitude) if diffuse_lx > 0 else 0.0

    towards = position.direction()
    x, y, z = towards.tolist()
    sky = SkyModel(pattern, (x, y, z), scale)
    diffuse_lx = sky.horizontal_illuminance() if scale > 0 else 0.0
    sun_rgb = _colour(spec, "sun_colour_temperature_k")
    sky_rgb = _colour(spec, "sky_colour_temperature_k")
    has_beam = sun_is_up and direct_lx > 0
    sun_illuminance = sun_rgb * direct_lx if has_beam else np.zeros(3)
    horizontal = sun_illuminance * max(z, 0.0) + sky_rgb * diffuse_lx
    return Condition(
        name=spec.name,
        spec=spec,
        sun=position,
        sun_direction=towards if has_beam else None,
        sun_illuminance_rgb=sun_illuminance,
        sky=sky,
        sky_rgb=sky_rgb,
        ground_luminance_rgb=spec.ground_albedo * horizontal / math.pi,
        diffuse_horizontal_lx=diffuse_lx,
        direct_normal_lx=direct_lx if has_beam else 0.0,
    )


def _pattern_and_default_levels(
    spec: ConditionSpec, choice: SkyChoice, position: SunPosition, time: datetime
) -> tuple[SkyPattern, float, float]:
    """The sky's pattern, and the direct normal and diffuse horizontal illuminance [lx] that it has unless told."""
    altitude, day = position.altitude_rad, time.timetuple().tm_yday
    if choice.kind == "none" or (choice.kind == "perez" and altitude <= 0):
        return CieSky(5), 0.0, 0.0
    if choice.kind == "cie":
        kind = availability.kind_of_cie_sky(choice.cie_type)
        return (
            CieSky(choice.cie_type),
            availability.direct_normal_illuminance(kind, altitude, day),
            availability.diffuse_horizontal_illuminance(kind, altitude),
        )
    direct, diffuse = choice.direct_normal_w_m2, choice.diffuse_horizontal_w_m2
    zenith_angle = math.pi / 2 - altitude
    clearness, brightness = perez_sky.clearness_and_brightness(direct, diffuse, zenith_angle, day)
    direct_efficacy, diffuse_efficacy = perez_sky.luminous_efficacies(clearness, brightness, zenith_angle)
    pattern = perez_sky.perez_sky(clearness, brightness, zenith_angle, _name(spec, "sky"))
    return pattern, direct * direct_efficacy, diffuse * diffuse_efficacy


def _checked_choice(spec: ConditionSpec) -> SkyChoice:
    """The parsed sky, after the checks that need no sun."""
    choice = parse_sky(spec.sky, _name(spec, "sky"))
    for field in ("zenith_luminance_cd_m2", "diffuse_horizontal_illuminance_lx", "direct_normal_illuminance_lx"):
        value = getattr(spec, field)
        if value is not None and not (math.isfinite(value) and value >= 0):
            raise InputError("must be a number of at least 0", field=_name(spec, field), value=value)
        if choice.kind == "none" and value:
            raise InputError(
                'gives light to sky = "none", which has no sun and no sky',
                field=_name(spec, field),
                value=value,
                remedy="Remove it, or choose another sky; for a sun in a black sky: "
                'sky = "uniform" with diffuse_horizontal_illuminance_lx = 0',
            )
    if spec.zenith_luminance_cd_m2 is not None and spec.diffuse_horizontal_illuminance_lx is not None:
        raise InputError(
            "and diffuse_horizontal_illuminance_lx both set the level of the sky",
            field=_name(spec, "zenith_luminance_cd_m2"),
            value=spec.zenith_luminance_cd_m2,
            remedy="Give one of the two",
        )
    if not 0 <= spec.ground_albedo <= 1:
        raise InputError("is outside 0..1", field=_name(spec, "ground_albedo"), value=spec.ground_albedo)
    return choice


def _check_levels(spec: ConditionSpec, choice: SkyChoice, position: SunPosition) -> None:
    """Refuses light that only a risen sun can give."""
    if position.altitude_rad > 0:
        return
    fields = ["direct_normal_illuminance_lx"]
    if choice.kind == "perez" or (choice.kind == "cie" and CieSky(choice.cie_type).depends_on_sun):
        fields += ["zenith_luminance_cd_m2", "diffuse_horizontal_illuminance_lx"]
    for field in fields:
        if getattr(spec, field):
            raise InputError(
                f"needs a sun above the horizon; at {spec.time} it stands at "
                f"{math.degrees(position.altitude_rad):.1f} degrees",
                field=_name(spec, field),
                value=getattr(spec, field),
                remedy="Choose a time of day, remove the level for a dark sky, or choose an overcast or uniform sky",
            )


def _zenith_value(spec: ConditionSpec, pattern: SkyPattern, sun_altitude_rad: float) -> float:
    value = relative_zenith_luminance(pattern, sun_altitude_rad)
    if value <= 0:
        raise InputError(
            "cannot set the level of a sky whose zenith is black",
            field=_name(spec, "zenith_luminance_cd_m2"),
            value=spec.zenith_luminance_cd_m2,
            remedy="Give diffuse_horizontal_illuminance_lx instead",
        )
    return value


def _colour(spec: ConditionSpec, field: str) -> Float64:
    """RGB with Y = 1 of that colour temperature; white where none is given."""
    kelvin = getattr(spec, field)
    if kelvin is None:
        return np.ones(3)
    return rgb_of_temperature(kelvin, _name(spec, field))


def _name(spec: ConditionSpec, field: str) -> str:
    return f"conditions.{spec.name}.{field}"


def _rounded(value: object) -> object:
    """Plain JSON values with numbers to KEY_DIGITS significant digits."""
    if isinstance(value, dict):
        return {name: _rounded(part) for name, part in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_rounded(part) for part in value]
    if isinstance(value, float):  # Also numpy's float64.
        return f"{value + 0.0:.{KEY_DIGITS - 1}e}"
    return value
