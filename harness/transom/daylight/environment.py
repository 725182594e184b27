"""The sky and the ground as a latitude-longitude image, for renderers that take an environment map."""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray

from transom.daylight.sky_model import Floats, SkyModel

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]


@functools.lru_cache(maxsize=4)
def environment_directions(height: int, single: bool = False) -> Floats:
    """Unit vectors (height, 2 height, 3) of the image's texels.

    Row j lies at the angle pi j / (height - 1) from the zenith, column i at the azimuth 2 pi (i + 1/2) / (2 height)
    from +x (east) towards +y (north): the texel positions between which Mitsuba's envmap interpolates bilinearly.
    """
    theta = np.pi * np.arange(height) / (height - 1)
    phi = np.pi * (np.arange(2 * height) + 0.5) / height
    sine = np.sin(theta)[:, None]
    directions: Floats = np.stack(
        [sine * np.cos(phi), sine * np.sin(phi), np.broadcast_to(np.cos(theta)[:, None], (height, 2 * height))], axis=-1
    ).astype(np.float32 if single else np.float64)
    directions.setflags(write=False)
    return directions


def environment_image(
    sky: SkyModel, sky_rgb: Float64, ground_rgb: Float64, height: int, *, single: bool = False
) -> Float32:
    """Radiance (height, 2 height, 3) in cd/m²: sky above the horizon, ground below it; no sun. height: at least 8.
    single: calculated in single precision (see SkyModel.luminance).

    For an even height the horizon falls midway between two rows, and interpolation shares that interval equally between
    sky and ground; for an odd height it falls on a row, which holds their mean. Both keep the horizontal and vertical
    illuminances of the interpolated image within 0.01 % of the analytic sky's from height 256 up.
    """
    if height < 8:
        raise ValueError(f"height = {height}: an environment image needs at least 8 rows")
    theta = np.pi * np.arange(height) / (height - 1)
    upper = theta < math.pi / 2 - 1e-9
    horizon = np.abs(theta - math.pi / 2) <= 1e-9
    image = np.empty((height, 2 * height, 3), dtype=np.float32)
    image[:] = ground_rgb
    directions = environment_directions(height, single)
    luminance = sky.luminance(directions[upper].reshape(-1, 3)).reshape(-1, 2 * height)
    image[upper] = luminance[..., None] * sky_rgb.astype(directions.dtype)
    if horizon.any():
        at_horizon = directions[horizon].reshape(-1, 3).copy()
        at_horizon[:, 2] = 0.0
        image[horizon] = (sky.luminance(at_horizon)[:, None] * sky_rgb + ground_rgb) / 2
    return image
