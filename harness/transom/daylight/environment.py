"""The sky and the ground as a latitude-longitude image, for renderers that take an environment map."""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray

from transom.daylight.sky_model import SkyModel

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]


@functools.lru_cache(maxsize=4)
def environment_directions(height: int) -> Float64:
    """Unit vectors (height, 2 height, 3) of the image's texels.

    Row j lies at the angle pi j / (height - 1) from the zenith, column i at the azimuth 2 pi (i + 1/2) / (2 height)
    from +x (east) towards +y (north): the texel positions between which Mitsuba's envmap interpolates bilinearly.
    """
    theta = np.pi * np.arange(height) / (height - 1)
    phi = np.pi * (np.arange(2 * height) + 0.5) / height
    sine = np.sin(theta)[:, None]
    directions: Float64 = np.stack(
        [sine * np.cos(phi), sine * np.sin(phi), np.broadcast_to(np.cos(theta)[:, None], (height, 2 * height))], axis=-1
    )
    directions.setflags(write=False)
    return directions


def environment_image(sky: SkyModel, sky_rgb: Float64, ground_rgb: Float64, height: int) -> Float32:
    """Radiance (height, 2 height, 3) in cd/m²: sky above the horizon, ground below it; no sun. height: at least 8.

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
    directions = environment_directions(height)
    luminance = sky.luminance(directions[upper].reshape(-1, 3)).reshape(-1, 2 * height)
    image[upper] = luminance[..., None] * sky_rgb
    if horizon.any():
        at_horizon = directions[horizon].reshape(-1, 3).copy()
        at_horizon[:, 2] = 0.0
        image[horizon] = (sky.luminance(at_horizon)[:, None] * sky_rgb + ground_rgb) / 2
    return image


@functools.lru_cache(maxsize=4)
def dome_directions(height: int) -> Float32:
    """Unit vectors (height, 4 height, 3) of the texels of `dome_image`."""
    theta = np.linspace(0, np.pi / 2, height)[:, None]
    phi = 2 * np.pi * (np.arange(4 * height) + 0.5) / (4 * height)
    z = np.maximum(np.cos(theta), 0.0)  # the last is -0 or rounding, and the sky ends below the horizon
    directions = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), z + 0 * phi], axis=-1)
    single = directions.astype(np.float32)
    single.setflags(write=False)
    return single


def dome_image(sky: SkyModel, height: int) -> Float32:
    """Luminance of the sky alone (height, 4 height) [cd/m²], in single precision (see SkyModel.luminance).

    Row 0 is the zenith, the last row the horizon, with equal steps between; column i lies at azimuth
    2 pi (i + 1/2) / (4 height) from +x (east) towards +y (north).
    """
    luminance = sky.luminance(dome_directions(height).reshape(-1, 3)).reshape(height, 4 * height)
    return luminance.astype(np.float32, copy=False)
