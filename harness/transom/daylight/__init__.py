"""Daylight: sun, sky and ground of one condition, as one function of direction that every renderer shares.

Directions are unit vectors pointing away from the observer: x east, y north, z up.
"""

from transom.daylight.condition import Condition, resolve_condition
from transom.daylight.sky_bins import SkyBins
from transom.daylight.sky_choice import parse_sky
from transom.daylight.sun import sun_position

__all__ = ["Condition", "SkyBins", "parse_sky", "resolve_condition", "sun_position"]
