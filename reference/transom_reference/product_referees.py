"""References of rooms with glazing products against each other, before any of them judges the engine."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from transom.bsdf.bsdf import Path as BsdfPath
from transom.bsdf.window_xml import write_klems_xml
from transom.colour import luminance
from transom.daylight.condition import Condition
from transom.fenestration.bins import PANEL_BINS
from transom.fenestration.panels import panel_groups
from transom.fenestration.reglazing import reglazed
from transom.products import load_product
from transom.products.goniophotometer import measure
from transom.products.section import Section
from transom.scene.model import Scene
from transom_reference.microgeometry import Microgeometry
from transom_reference.mitsuba_renderer import MitsubaRenderer
from transom_reference.mitsuba_scene import stock_illuminance
from transom_reference.radiance_renderer import RadianceRenderer

Float64 = NDArray[np.float64]

PORTAL, VOLPATH, RADIANCE = "portals", "volpath, BSDF", "Radiance, BSDF"
SECTION, PARTICLES = "section tracer", "particles, triangles"

SENSORS = 3
PORTAL_BATCHES = 16
STOCK_SAMPLES, STOCK_BATCHES = 1 << 19, 16
RADIANCE_PASSES = 8
PARTICLE_COUNT = 1 << 20
SECTION_RAYS = 1 << 16
SLIT_M = 4e-6
"""A cut without width is given to particles as a slit, a thousandth of the panel's spacing."""

ALTITUDES_DEG = (20.0, 45.0, 65.0)
"""Suns for particles, at 25 degrees beside the panel's normal."""


@dataclass(frozen=True)
class Estimate:
    """A value and its standard error."""

    value: float
    error: float


@dataclass(frozen=True)
class Comparison:
    """Two methods' answers to one question."""

    product: str
    quantity: str
    place: str
    first: str
    second: str
    one: Estimate
    other: Estimate
    unit: str
    note: str = ""


def rooms(scene: Scene, condition: Condition, opening: str, product: str) -> Iterator[Comparison]:
    """Illuminances at sensors of the scene: the same XML file in the portals, in volpath and in Radiance.

    All light is spread over the file's bins, the sun's too. The openings beside `opening` are closed.
    """
    points = np.concatenate([entry.points for entry in scene.sensors])
    normals = np.concatenate([entry.normals for entry in scene.sensors])
    chosen = np.linspace(0, len(points) - 1, SENSORS).round().astype(int)
    points, normals = points[chosen], normals[chosen]
    with tempfile.TemporaryDirectory(prefix="transom-referees-") as folder:
        file = Path(folder) / f"{product}.xml"
        bsdf = measure(load_product(product)).bsdf
        # Radiance reads the transmission from the room by reciprocity; two tables are reciprocal to their noise alone.
        kept = {key: table for key, table in bsdf.scattering.items() if key[1] is not BsdfPath.transmission_back}
        write_klems_xml(file, replace(bsdf, scattering=kept))
        others = [f"{entry.name}=clear:0" for entry in scene.openings if entry.name != opening]
        room = reglazed(scene, [f"{opening}={file}", *others])
        sky = replace(condition, sun_direction=None, sun_illuminance_rgb=np.zeros(3))
        for light, case in (("sky", sky), ("sun and sky", condition)):
            portal = _portal(room, case, points, normals)
            rivals = {VOLPATH: _stock(room, case, points, normals), RADIANCE: _radiance(room, case, points, normals)}
            for name, found in rivals.items():
                for number, (one, other) in enumerate(zip(portal, found, strict=True)):
                    place = f"sensor {chosen[number] + 1}, {light}"
                    yield Comparison(product, "illuminance", place, PORTAL, name, one, other, "lx")


def _portal(scene: Scene, condition: Condition, points: Float64, normals: Float64) -> list[Estimate]:
    found = MitsubaRenderer().illuminance(scene, condition, points, normals, {"batches": PORTAL_BATCHES})
    values = luminance(found.illuminance)
    return [Estimate(float(a), float(b)) for a, b in zip(values, found.standard_error, strict=True)]


def _stock(scene: Scene, condition: Condition, points: Float64, normals: Float64) -> list[Estimate]:
    runs = [
        luminance(stock_illuminance(scene, condition, points, normals, STOCK_SAMPLES, seed))
        for seed in range(1, STOCK_BATCHES + 1)
    ]
    errors = np.std(runs, axis=0, ddof=1) / np.sqrt(STOCK_BATCHES)
    return [Estimate(float(a), float(b)) for a, b in zip(np.mean(runs, axis=0), errors, strict=True)]


def _radiance(scene: Scene, condition: Condition, points: Float64, normals: Float64) -> list[Estimate]:
    options = {"preset": "exact", "passes": RADIANCE_PASSES}
    found = RadianceRenderer().illuminance(scene, condition, points, normals, options)
    values = luminance(found.illuminance)
    return [Estimate(float(a), float(b)) for a, b in zip(values, found.standard_error, strict=True)]


def microgeometry(product: str) -> Iterator[Comparison]:
    """Transmittance, and light sent to other bins, by particles through triangles and by the section tracer.

    Nothing for a product that is no section, or that scatters: particles know interfaces and mirrors.
    """
    given = load_product(product)
    is_cut = "kerf" in given.record.parameters or product == "laser_cut_panel"
    if not isinstance(given.tracer(), Section):
        return
    section = given.section()
    true = given.with_parameters({"kerf": SLIT_M}).section() if is_cut else section
    if any(line.kind not in ("interface", "mirror") for line in true.lines):
        return
    geometry = Microgeometry(true)
    for altitude in ALTITUDES_DEG:
        up, aside = np.radians(altitude), np.radians(25.0)
        incident = np.array([np.cos(up) * np.sin(aside), -np.sin(up), np.cos(up) * np.cos(aside)])
        particles = geometry.trace(incident, PARTICLE_COUNT, 1)
        traced = section.trace(incident, SECTION_RAYS, 1)
        total = particles.transmittance
        error = float(np.sqrt(max(float((particles.weights**2).sum()) - total**2 / PARTICLE_COUNT, 0.0)))
        place = f"sun at {altitude:g}°, 25° beside the normal"
        one, other = Estimate(traced.transmitted.total, 0.0), Estimate(total, error)
        note = f"slit of {1e6 * SLIT_M:g} µm" if is_cut else ""
        yield Comparison(product, "transmittance", place, SECTION, PARTICLES, one, other, "", note)
        share, errors = particles.binned(PANEL_BINS.bin_of(particles.transmitted), PANEL_BINS.count)
        bins = PANEL_BINS.bin_of(traced.transmitted.directions)
        expected = np.bincount(bins, traced.transmitted.flux, PANEL_BINS.count)
        moved = Estimate(0.5 * float(np.abs(share - expected).sum()), 0.5 * float(np.sqrt(2 / np.pi) * errors.sum()))
        note = "its error is what noise alone would move"
        yield Comparison(product, "flux in other bins", place, SECTION, PARTICLES, Estimate(0.0, 0.0), moved, "", note)


def convergence(scene: Scene, condition: Condition, opening: str, product: str) -> Iterator[tuple[str, int, float]]:
    """Relative standard error of one sensor against the paths spent on it: (method, paths, error), portals and volpath.

    The product is as in the suites, lobes and all; volpath has them as cones.
    """
    room = reglazed(scene, [f"{opening}={product}"])
    assert panel_groups(room)
    points, normals = scene.sensors[0].points[:1], scene.sensors[0].normals[:1]
    runs: dict[str, tuple[int, Callable[[int], Estimate]]] = {
        PORTAL: (1 << 16, lambda count: _sensor_portal(room, condition, points, normals, count)),
    }
    for name, (paths, run) in runs.items():
        for count in (4, 8, 16, 32, 64):
            found = run(count)
            yield name, paths * count, found.error / found.value
    for log2 in (14, 16, 18):
        values = [luminance(stock_illuminance(room, condition, points, normals, 1 << log2, k))[0] for k in range(1, 9)]
        yield VOLPATH, 8 << log2, float(np.std(values, ddof=1) / np.sqrt(8) / np.mean(values))


def _sensor_portal(scene: Scene, condition: Condition, points: Float64, normals: Float64, batches: int) -> Estimate:
    found = MitsubaRenderer().illuminance(scene, condition, points, normals, {"batches": batches, "seed": batches})
    return Estimate(float(luminance(found.illuminance)[0]), float(found.standard_error[0]))
