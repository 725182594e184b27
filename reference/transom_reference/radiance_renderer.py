"""The second referee: Radiance's rtrace on the same scene, with presets whose parameters are recorded.

preset     images                                    sensors
fast       irradiance cache, coarse                  the same cache
accurate   irradiance cache, fine                    the same cache
exact      paths, no cache: noise and no bias        paths from cosine-distributed rays, no cache

"parameters" replaces the preset's own, as the steps of a ladder do.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from transom.colour import luminance
from transom.daylight.condition import Condition
from transom.errors import InputError
from transom.renderer import ImageResult, Progress, SensorResult
from transom.scene.model import Scene, View
from transom_reference.radiance_daylight import lumens
from transom_reference.radiance_programs import radiance_version, trace, trace_parts
from transom_reference.radiance_scene import write_scene

Float64 = NDArray[np.float64]


@dataclass(frozen=True)
class Preset:
    """parameters: of rtrace. samples: rays across a pixel (samples² in all), or log2 of the paths of a sensor in one
    pass. passes: independent repetitions."""

    parameters: str
    pixel_samples: int
    sensor_log2_paths: int
    passes: int


PRESETS: dict[str, Preset] = {
    "fast": Preset("-ab 3 -ad 400 -as 64 -aa 0.2 -ar 64 -lr 6 -lw 0.001", 2, 0, 1),
    "accurate": Preset("-ab 10 -ad 1024 -as 256 -aa 0.12 -ar 160 -lr 12 -lw 0.0002", 3, 0, 1),
    "exact": Preset("-ab 100 -ad 1 -as 0 -aa 0 -lr -120 -lw 0.2", 2, 15, 32),
}

DIRECT_PARAMETERS = "-dv- -dt 0 -dc 1 -dr 0 -dp 0 -dj 1 -ds 0 -ss 0 -st 0"
"""Of all presets: every source tested at a random point of it, no sampling of gloss."""

CACHED_PARAMETERS, PATH_PARAMETERS = "-u-", "-u+"
"""Correlated sampling is repeatable, and right where many rays are averaged at each place. With one ray at each place
it makes paths 1 % too bright (an empty box of three tones: 1442 +- 1.2 lx instead of 1422.0); uncorrelated sampling is
right (1421.5 +- 1.5). rtrace seeds it by the clock: paths repeat within their standard error, not bit by bit."""

LIGHT_SAMPLES = 64
"""Points of the sun's disc and of point sources that a sensor looks at in one pass."""

OVERTURE_STEP = 4
"""Every so many-th pixel across and down fills the irradiance cache before the picture is traced."""


class RadianceRenderer:
    """Radiance's rtrace. `version` rises when answers may change."""

    name = "radiance"
    version = "1"

    def default_options(self) -> dict[str, Any]:
        """preset: "fast", "accurate" or "exact". physics: "matched" (hard sun, diffuse room side of glass) or "full".

        parameters: rtrace's parameters instead of the preset's, such as "-ab 4 -ad 512 -as 128 -aa 0.15 -ar 64".
        samples: rays across a pixel, or log2 of the paths of a sensor in one pass;
        passes: independent repetitions; 0: as the preset has them. seed: any integer.
        """
        return {
            "preset": "accurate",
            "physics": "matched",
            "parameters": "",
            "samples": 0,
            "passes": 0,
            "seed": 1,
        }

    def render(
        self,
        scene: Scene,
        condition: Condition,
        view: View,
        options: Mapping[str, Any],
        progress: Progress | None = None,
    ) -> ImageResult:
        """The view's image (height, width, 3) [cd/m²]; halves and standard error where there are two passes or more."""
        settings = self._settings(options)
        preset = _chosen(settings)
        across = settings["samples"] or preset.pixel_samples
        passes = settings["passes"] or preset.passes
        began = time.perf_counter()
        with tempfile.TemporaryDirectory(prefix="transom-radiance-") as name:
            octree = write_scene(Path(name), scene, condition, full_physics=settings["physics"] == "full")
            arguments = [*_arguments(preset), *_product_arguments(scene)]
            effort = (passes, across, settings["seed"])
            if _is_cached(arguments):
                images = _cached_images(octree, arguments, view, effort, progress)
            else:
                images = _traced_images(octree, arguments, view, effort, progress)
        facts = _facts(settings, preset, passes, time.perf_counter() - began)
        facts["rays_per_pixel"] = across**2 * passes
        mean = np.mean(images, axis=0).astype(np.float32)
        if passes < 2:
            return ImageResult(mean, facts=facts)
        halves = [np.mean(images[start::2], axis=0).astype(np.float32) for start in (0, 1)]
        error = np.std(luminance(np.array(images)), axis=0, ddof=1) / np.sqrt(passes)
        return ImageResult(mean, (halves[0], halves[1]), error.astype(np.float32), facts=facts)

    def illuminance(
        self,
        scene: Scene,
        condition: Condition,
        points: Float64,
        normals: Float64,
        options: Mapping[str, Any],
        progress: Progress | None = None,
    ) -> SensorResult:
        """Illuminance [lx] at points (N, 3) [m] with unit normals (N, 3), and its standard error over passes (0 where
        there is one pass: "fast")."""
        settings = self._settings(options)
        preset = _chosen(settings)
        points, normals = np.asarray(points, dtype=np.float64), np.asarray(normals, dtype=np.float64)
        if points.ndim != 2 or points.shape[1:] != (3,) or points.shape != normals.shape or len(points) == 0:
            raise InputError("must both have the same shape (N, 3), N >= 1", field="points, normals")
        passes = settings["passes"] or preset.passes
        began = time.perf_counter()
        arguments = [*_arguments(preset), *_product_arguments(scene)]
        with tempfile.TemporaryDirectory(prefix="transom-radiance-") as name:
            folder = Path(name)
            octree = write_scene(folder, scene, condition, full_physics=settings["physics"] == "full")
            if _is_cached(arguments):
                values, paths = _cached(octree, arguments, points, normals, passes, progress), 0
            else:
                paths = 1 << (settings["samples"] or preset.sensor_log2_paths)
                lights = [*DIRECT_PARAMETERS.split(), PATH_PARAMETERS, "-ab", "0", "-lr", "120", "-lw", "0"]
                values = _traced(octree, arguments, points, normals, (passes, paths, settings["seed"]), progress)
                values += _from_lights(octree, lights, points, normals, passes)
        illuminance = lumens(values)
        error = np.zeros(len(points))
        if passes > 1:
            error = np.std(luminance(illuminance), axis=0, ddof=1) / np.sqrt(passes)
        facts = _facts(settings, preset, passes, time.perf_counter() - began)
        facts["paths_per_sensor"] = paths * passes
        return SensorResult(illuminance.mean(axis=0), error, facts)

    def _settings(self, options: Mapping[str, Any]) -> dict[str, Any]:
        defaults = self.default_options()
        unknown = sorted(set(options) - set(defaults))
        if unknown:
            raise InputError(
                "is not an option of the Radiance renderer", field=unknown[0], remedy=f"Known: {', '.join(defaults)}"
            )
        settings = {**defaults, **options}
        allowed = {"preset": tuple(PRESETS), "physics": ("matched", "full")}
        for field, values in allowed.items():
            if settings[field] not in values:
                raise InputError(
                    "is not known", field=field, value=settings[field], remedy=f"Choose one of {', '.join(values)}"
                )
        for field, most in (("samples", 30), ("passes", 4096)):
            if not 0 <= settings[field] <= most:
                raise InputError(f"is outside 0..{most}", field=field, value=settings[field])
        return settings


def pixel_rays(view: View, across: int, generator: np.random.Generator) -> Float64:
    """Rays (pixels x across², 6) through jittered strata of each pixel, row by row from the upper left: a box filter.

    Raises InputError when target and position coincide or `up` points along them.
    """
    position, target, up = (np.array(v, dtype=np.float64) for v in (view.position, view.target, view.up))
    forward = target - position
    right = np.cross(forward, up)
    if np.linalg.norm(forward) == 0 or np.linalg.norm(right) == 0:
        raise InputError("has no direction: target, position and up are on one line", field=f"views.{view.name}")
    forward, right = forward / np.linalg.norm(forward), right / np.linalg.norm(right)
    half_height = np.tan(0.5 * view.vertical_fov_rad)
    half_width = half_height * view.width / view.height
    shape = (view.height, view.width, across, across)
    row, column, sub_row, sub_column = np.indices(shape)
    x = (column + (sub_column + generator.random(shape)) / across) / view.width
    y = (row + (sub_row + generator.random(shape)) / across) / view.height
    rays = np.empty((*shape, 6))
    rays[..., :3] = position
    rays[..., 3:] = (
        forward
        + ((2 * x - 1) * half_width)[..., None] * right
        + ((1 - 2 * y) * half_height)[..., None] * np.cross(right, forward)
    )
    rays[..., 3:] /= np.linalg.norm(rays[..., 3:], axis=-1, keepdims=True)
    return rays.reshape(-1, 6)


def _cached_images(
    octree: Path, arguments: list[str], view: View, effort: tuple[int, int, int], progress: Progress | None
) -> list[Float64]:
    """One image a pass [cd/m²], each with its own irradiance cache, which an overture has filled.

    effort: passes, rays across a pixel, seed.
    """
    passes, across, seed = effort
    images = []
    for index in range(passes):
        rays = pixel_rays(view, across, np.random.default_rng([seed & 0xFFFFFFFF, index]))
        cache = ["-af", f"cache_{index}.amb"]
        first = rays.reshape(view.height, view.width, -1, 6)[::OVERTURE_STEP, ::OVERTURE_STEP, 0]
        trace(octree, [*arguments, *cache], first.reshape(-1, 6))
        found = trace(octree, [*arguments, *cache], rays, _part(progress, index, passes))
        images.append(_pixels(found, view, across))
    return images


def _traced_images(
    octree: Path, arguments: list[str], view: View, effort: tuple[int, int, int], progress: Progress | None
) -> list[Float64]:
    """One image a pass [cd/m²], all by one process: a second one would begin the same random numbers again."""
    passes, across, seed = effort
    rays = (pixel_rays(view, across, np.random.default_rng([seed & 0xFFFFFFFF, index])) for index in range(passes))
    row_size = view.width * across**2
    rows: list[Float64] = []
    for row in trace_parts(octree, arguments, rays, row_size):
        rows.append(lumens(row).reshape(view.width, across**2, 3).mean(axis=1))
        if progress is not None:
            progress(len(rows), passes * view.height)
    return [np.stack(rows[index * view.height : (index + 1) * view.height]) for index in range(passes)]


def _pixels(found: NDArray[np.float32], view: View, across: int) -> Float64:
    """Box-filtered image (height, width, 3) [cd/m²] of rays in the order of `pixel_rays`."""
    image: Float64 = lumens(found).reshape(view.height, view.width, across**2, 3).mean(axis=2)
    return image


def _chosen(settings: Mapping[str, Any]) -> Preset:
    preset = PRESETS[settings["preset"]]
    if settings["parameters"]:
        preset = replace(preset, parameters=settings["parameters"])
    return preset


def _arguments(preset: Preset) -> list[str]:
    """Of rtrace: the preset's own, then those of all."""
    arguments = [*preset.parameters.split(), *DIRECT_PARAMETERS.split()]
    return [*arguments, CACHED_PARAMETERS if _is_cached(arguments) else PATH_PARAMETERS]


def _product_arguments(scene: Scene) -> list[str]:
    """Scattering by a product's table is sampled within its bins; without sampling Radiance takes a bin's middle, and
    the bins that lie across the horizon then see sky or ground alone: 25 % too much or too little on a wall."""
    return ["-ss", "1"] if any(opening.product is not None for opening in scene.openings) else []


def _is_cached(arguments: list[str]) -> bool:
    """Whether rtrace interpolates irradiance: ambient accuracy above 0 (its default is)."""
    return "-aa" not in arguments or float(arguments[arguments.index("-aa") + 1]) > 0


def _part(progress: Progress | None, index: int, count: int) -> Progress | None:
    """Progress of one of several equal parts."""
    if progress is None:
        return None
    return lambda done, total: progress(index * total + done, count * total)


def _cached(
    octree: Path, arguments: list[str], points: Float64, normals: Float64, passes: int, progress: Progress | None
) -> Float64:
    """Irradiance (passes, N, 3), each pass with its own cache and its own order of the sensors."""
    values = np.empty((passes, len(points), 3))
    for index in range(passes):
        # Another order gives every sensor other random numbers.
        order = np.roll(np.arange(len(points)), index)
        places = np.hstack([points, normals])[order]
        if index:
            places = np.vstack([places[:index], places])
        found = trace(octree, arguments, places, _part(progress, index, passes), irradiance=True)
        values[index, order] = found[len(found) - len(points) :]
    return values


def _traced(
    octree: Path,
    arguments: list[str],
    points: Float64,
    normals: Float64,
    effort: tuple[int, int, int],
    progress: Progress | None,
) -> Float64:
    """Irradiance (passes, N, 3) by radiance along cosine-distributed rays, without what light sources give directly.

    effort: passes, paths a sensor in one pass, seed.
    """
    passes, paths, seed = effort
    values = np.empty((passes, len(points), 3))

    def rays() -> Iterator[Float64]:
        for index, sensor in np.ndindex(passes, len(points)):
            scramble = np.random.default_rng([seed & 0xFFFFFFFF, index, sensor])
            chunk = np.empty((paths, 6))
            chunk[:, :3] = points[sensor]
            chunk[:, 3:] = _cosine_directions(normals[sensor], paths, scramble)
            yield chunk

    # One process for all passes: a second one would begin the same random numbers again.
    for number, found in enumerate(trace_parts(octree, arguments, rays(), paths)):
        index, sensor = divmod(number, len(points))
        values[index, sensor] = np.pi * found.astype(np.float64).mean(axis=0)
        if progress is not None:
            progress(number + 1, passes * len(points))
    return values


def _from_lights(octree: Path, arguments: list[str], points: Float64, normals: Float64, passes: int) -> Float64:
    """Irradiance (passes, N, 3) straight from the sun and point sources; passes differ where the sun is a disc."""
    places = np.hstack([points, normals])
    found = trace(octree, arguments, np.tile(places, (passes * LIGHT_SAMPLES, 1)), irradiance=True)
    by_pass = found.astype(np.float64).reshape(passes, LIGHT_SAMPLES, len(points), 3)
    return np.asarray(by_pass.mean(axis=1))


def _cosine_directions(normal: Float64, count: int, generator: np.random.Generator) -> Float64:
    """Unit vectors (count, 3) about a unit normal, density cos / pi: scrambled Sobol points on the disc. count: 2^k."""
    u = qmc.Sobol(2, scramble=True, rng=generator).random(count)
    radius, angle = np.sqrt(u[:, 0]), 2 * np.pi * u[:, 1]
    helper = np.eye(3)[int(np.argmin(np.abs(normal)))]
    tangent = np.cross(normal, helper)
    tangent /= np.linalg.norm(tangent)
    local = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(np.maximum(0.0, 1 - u[:, 0]))], axis=1)
    directions: Float64 = local @ np.stack([tangent, np.cross(normal, tangent), normal])
    return directions


def _facts(settings: Mapping[str, Any], preset: Preset, passes: int, seconds: float) -> dict[str, Any]:
    return {
        "program": radiance_version(),
        "preset": settings["preset"],
        "parameters": " ".join(_arguments(preset)),
        "passes": passes,
        "seconds": round(seconds, 3),
    }
