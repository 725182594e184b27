"""The skies against Radiance's own programs: gensky (CIE), gendaylit and gendaymtx (Perez).

Radiance blends the ground into the sky near the horizon; with a black ground its luminance is the sky's times
w / (w + 1 / w), w = (Dz + 1.01)^10 (skybright.cal, perezlum.cal), which is divided out here. Sun directions are given
to both sides, so that Radiance's coarser sun formula does not count.
"""

from __future__ import annotations

import math
import os
import subprocess
from pathlib import Path

import numpy as np
import pyradiance
import pytest
from numpy.typing import NDArray

from transom.daylight.cie_sky import CieSky
from transom.daylight.perez_sky import clearness_and_brightness, luminous_efficacies, perez_sky
from transom.daylight.sky_model import SkyModel, SkyPattern, relative_horizontal_illuminance

Float64 = NDArray[np.float64]

RADIANCE = Path(pyradiance.__file__).parent
WHITE_EFFICACY_LM_W = 179.0  # Radiance's fixed ratio of luminance to radiance.
GLOW = "\nskyfunc glow sky_glow 0 0 4 1 1 1 0\nsky_glow source sky 0 0 4 0 0 1 360\n"


def radiance(program: str, *arguments: object, stdin: bytes = b"") -> bytes:
    return subprocess.run(
        [RADIANCE / "bin" / program, *map(str, arguments)],
        env={**os.environ, "RAYPATH": str(RADIANCE / "lib")},
        input=stdin,
        capture_output=True,
        check=True,
    ).stdout


def radiance_sky_luminance(description: bytes, directions: Float64, folder: Path) -> Float64:
    """Luminance of Radiance's sky, its horizon blend divided out [cd/m²]; by rtrace of the sky program's output."""
    octree = folder / "sky.oct"
    octree.write_bytes(radiance("oconv", "-", stdin=description + GLOW.encode()))
    rays = np.hstack([np.zeros_like(directions), directions]).astype("<f4")
    out = radiance("rtrace", "-h", "-w", "-ab", 0, "-ffa", octree, stdin=rays.tobytes())
    values = np.array(out.split(), dtype=float).reshape(-1, 3)[:, 1] * WHITE_EFFICACY_LM_W
    weight = (directions[:, 2] + 1.01) ** 10
    return np.asarray(values * (weight + 1 / weight) / weight, dtype=np.float64)


def some_directions() -> Float64:
    """400 directions from 1 degree above the horizon up; below Dz = 0.01 Radiance stops its gradation."""
    rng = np.random.default_rng(5)
    sine = rng.uniform(math.sin(math.radians(1.0)), 1.0, 400)
    azimuth = rng.uniform(0, 2 * math.pi, 400)
    across = np.sqrt(1 - sine**2)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), sine], axis=1)


def sky_with(pattern: SkyPattern, altitude_deg: float, azimuth_south_west_deg: float) -> SkyModel:
    """Unit scale; azimuth as gensky -ang counts it, from south towards west."""
    altitude, azimuth = math.radians(altitude_deg), math.radians(azimuth_south_west_deg)
    across = math.cos(altitude)
    return SkyModel(pattern, (-across * math.sin(azimuth), -across * math.cos(azimuth), math.sin(altitude)), 1.0)


@pytest.mark.parametrize(("flag", "cie_type"), [("-s", 12), ("-c", 16), ("-u", 5)])
@pytest.mark.parametrize("altitude_deg", [12.0, 40.0, 65.0])
def test_cie_luminance_relative_to_the_zenith_is_genskys(
    flag: str, cie_type: int, altitude_deg: float, tmp_path: Path
) -> None:
    """2e-3: gensky prints four digits, and its clear sky has 0.91 where the standard's formula gives 0.91017."""
    directions = np.vstack([some_directions(), [0.0, 0.0, 1.0]])
    text = radiance("gensky", "-ang", altitude_deg, 30, flag, "-g", 0)
    theirs = radiance_sky_luminance(text, directions, tmp_path)
    ours = sky_with(CieSky(cie_type), altitude_deg, 30).luminance(directions)
    assert ours / ours[-1] == pytest.approx(theirs / theirs[-1], rel=2e-3)


@pytest.mark.parametrize("flag", ["-c", "-u"])
def test_overcast_level_from_horizontal_illuminance_is_genskys(flag: str, tmp_path: Path) -> None:
    """gensky -B: horizontal diffuse irradiance 100 W/m². 1e-3: four printed digits, and 0.7778 for 7/9."""
    directions = some_directions()
    theirs = radiance_sky_luminance(radiance("gensky", "-ang", 40, 30, flag, "-g", 0, "-B", 100), directions, tmp_path)
    pattern = CieSky(16 if flag == "-c" else 5)
    scale = 100 * WHITE_EFFICACY_LM_W / relative_horizontal_illuminance(pattern, 0.7)
    assert scale * sky_with(pattern, 40, 30).luminance(directions) == pytest.approx(theirs, rel=1e-3)


@pytest.mark.parametrize(
    ("clearness", "brightness"),
    [(1.02, 0.2), (1.15, 0.3), (1.4, 0.3), (1.7, 0.15), (2.3, 0.25), (3.5, 0.15), (5.0, 0.1), (8.0, 0.08)],
)
@pytest.mark.parametrize("altitude_deg", [20.0, 55.0])
def test_perez_luminance_is_gendaylits(
    clearness: float, brightness: float, altitude_deg: float, tmp_path: Path
) -> None:
    """All eight bins. Shape to 2e-3 (four digits in the file). Level to 4 %: gendaylit normalises over 145 points.

    gendaylit -ang knows no date: its day number is 0. Where the formula falls below zero, ours is 0.
    """
    directions = some_directions()
    text = radiance("gendaylit", "-ang", altitude_deg, 30, "-P", clearness, brightness, "-g", 0, "-O", 2, "-w")
    theirs = radiance_sky_luminance(text, directions, tmp_path) / WHITE_EFFICACY_LM_W  # -O 2 writes cd/m².
    zenith_angle = math.radians(90 - altitude_deg)
    sky = sky_with(perez_sky(clearness, brightness, zenith_angle), altitude_deg, 30)
    ours = sky.luminance(directions)
    positive = ours > 0.02 * ours.max()
    ratio = theirs[positive] / ours[positive]
    assert ratio / np.median(ratio) == pytest.approx(np.ones(len(ratio)), abs=2e-3)

    air_mass = 1 / (math.cos(zenith_angle) + 0.15 * (93.885 - 90 + altitude_deg) ** -1.253)
    distance = 1.00011 + 0.034221 * math.cos(2 * math.pi / 365) - 0.00128 * math.sin(2 * math.pi / 365) + 0.0008
    diffuse_w_m2 = brightness / air_mass * 1367 * distance
    _, efficacy = luminous_efficacies(clearness, brightness, zenith_angle)
    scale = diffuse_w_m2 * efficacy / relative_horizontal_illuminance(sky.pattern, math.radians(altitude_deg))
    assert np.median(ratio) == pytest.approx(scale, rel=4e-2)


@pytest.mark.parametrize(("direct_w_m2", "diffuse_w_m2"), [(600, 120), (850, 70), (150, 250), (0, 180)])
def test_perez_sky_vector_is_gendaymtxs(direct_w_m2: float, diffuse_w_m2: float) -> None:
    """Radiance's 2305 Reinhart patches from irradiances, date and place: efficacy, clearness, brightness and pattern.

    The value of a patch is that of its centre (azimuths 2 pi j / n clockwise from north). 1 % for each patch within a
    scale that agrees to 2 %: gendaymtx normalises by the sum over its patches.
    """
    wea = (
        "place London\nlatitude 51.5\nlongitude 0.12\ntime_zone 0\nsite_elevation 0\nweather_data_file_units 1\n"
        f"3 21 10.0 {direct_w_m2} {diffuse_w_m2}\n"
    )
    out = radiance("gendaymtx", "-h", "-m", 4, "-s", "-c", 1, 1, 1, "-of", stdin=wea.encode())
    theirs = np.frombuffer(out, "<f4").reshape(-1, 3)[1:, 1].astype(float) * WHITE_EFFICACY_LM_W
    centres, solid_angles = radiance_patches(4)
    sun = np.array(radiance("gensky", 3, 21, 10, "-a", 51.5, "-o", 0.12, "-m", 0).split()[-3:], dtype=float)

    zenith_angle = math.acos(sun[2])
    clearness, brightness = clearness_and_brightness(direct_w_m2, diffuse_w_m2, zenith_angle, 80)
    pattern = perez_sky(clearness, brightness, zenith_angle)
    level_lx = diffuse_w_m2 * luminous_efficacies(clearness, brightness, zenith_angle)[1]
    scale = level_lx / relative_horizontal_illuminance(pattern, math.pi / 2 - zenith_angle)
    ours = SkyModel(pattern, tuple(sun / np.linalg.norm(sun)), scale).luminance(centres)
    assert (theirs * solid_angles * centres[:, 2]).sum() == pytest.approx(level_lx, rel=1e-2)
    ratio = theirs / ours
    assert np.median(ratio) == pytest.approx(1.0, abs=2e-2)
    assert ratio / np.median(ratio) == pytest.approx(np.ones(len(ratio)), abs=1e-2)


def radiance_patches(subdivision: int) -> tuple[Float64, Float64]:
    """Centres (N, 3) and solid angles (N,) of gendaymtx's sky patches."""
    height = math.pi / 2 / (7 * subdivision + 0.5)
    centres, solid_angles = [], []
    for row, count in enumerate(subdivision * np.repeat([30, 30, 24, 24, 18, 12, 6], subdivision)):
        azimuth, altitude = 2 * math.pi * np.arange(count) / count, height * (row + 0.5)
        across = math.cos(altitude)
        centres.append(
            np.stack([across * np.sin(azimuth), across * np.cos(azimuth), np.full(count, math.sin(altitude))], axis=1)
        )
        zone = 2 * math.pi * (math.sin(height * (row + 1)) - math.sin(height * row))
        solid_angles.append(np.full(count, zone / count))
    return (
        np.vstack([*centres, [[0.0, 0.0, 1.0]]]),
        np.append(np.concatenate(solid_angles), 2 * math.pi * (1 - math.cos(height / 2))),
    )
