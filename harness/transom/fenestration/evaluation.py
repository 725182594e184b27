"""How well lobes stand for light: fractions represented, errors between measured directions, errors in a room."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from transom.daylight.cie_sky import CieSky
from transom.fenestration.bins import PANEL_BINS
from transom.fenestration.interpolation import LobeTable
from transom.fenestration.landing import TARGETS, bin_landing, illuminance, landed, landed_represented
from transom.fenestration.moved_flux import as_points, moved_share
from transom.fenestration.paper_modes import greedy_split
from transom.fenestration.path_tracer import trace_paths
from transom.fenestration.splitting import split
from transom.fenestration.through import SunThrough
from transom.fenestration.traced import TracedFenestration
from transom.products.by_direction import incident_grid
from transom.products.product import Product
from transom.products.section import Exits, Section

Float64 = NDArray[np.float64]

COUNTS = tuple(range(1, 9))
WIDTHS_DEG = (2.0, 4.0, 8.0, 15.0, 23.0, 30.0)
COARSE_STEP_DEG, FINE_STEP_DEG = 12.0, 6.0
"""Of grids of incident directions: for what is left out in turn, and for the room."""

STAGES = 4
TABLE_RAYS = 256
MAXIMUM_POLAR_DEG = 75.0
"""Incident directions beyond which nothing is left out: there a neighbour is missing on one side."""


class Errors(BaseModel):
    """Relative errors of illuminance by sun (rows) and target (columns: floor, three desks), signed."""

    model_config = ConfigDict(frozen=True)
    relative: list[list[float]]

    def quantile(self, share: float) -> float:
        return float(np.quantile(np.abs(self.relative), share))


class ProductEvaluation(BaseModel):
    """All figures of one product. rays: of the second tracer, for each sun.

    represented: by width (rows, WIDTHS_DEG) and count (columns, COUNTS), the mean over incident directions of the
    share of the transmitted light that lies in so many greedy cones; represented_least: the least.
    moved_*: of all light of the directions left out in turn, the share that must be moved by more than 11.5 degrees.
    traced, tabulated: errors in the room, of lobes + residual at the actual sun and between directions 6 degrees apart;
    tracer: of the engine's rays without any representation. sky: errors under a clear sky, one row.
    transmittance_*: greatest difference over the suns from a second tracer's, whose own uncertainty stands beside it.
    """

    model_config = ConfigDict(frozen=True)
    product: str
    rays: int
    represented: list[list[float]]
    represented_least: list[list[float]]
    moved_ours: float
    moved_rank: float
    moved_paper: float
    moved_nearest: float
    traced: Errors
    tabulated: Errors
    tracer: Errors
    sky: Errors
    transmittance_mean_difference: float
    transmittance_uncertainty: float
    split_difference: float


def evaluate(
    product: Product, rays: int = 1024, every: int = 3, progress: Callable[[int, int], None] | None = None
) -> ProductEvaluation:
    """Evaluates a product. rays: of the second tracer, for each of 24 suns. every: of the incident directions of the
    coarse grid, each such one is left out in turn."""
    geometry = product.tracer()
    fenestration = TracedFenestration(geometry)
    _tell(progress, 0)
    coarse_incident, coarse = _exits(fenestration, COARSE_STEP_DEG)
    represented = np.array([_represented(exits) for exits in coarse if exits.total > 0])
    _tell(progress, 1)
    moved = _left_out(coarse_incident, coarse, every)
    _tell(progress, 2)
    errors, differences, uncertainty, split_difference = _room_errors(fenestration, rays)
    _tell(progress, 3)
    sky = Errors(relative=[_sky_errors(fenestration).tolist()])
    _tell(progress, 4)
    return ProductEvaluation(
        product=product.name,
        rays=rays,
        represented=represented.mean(axis=0).tolist(),
        represented_least=represented.min(axis=0).tolist(),
        moved_ours=float(moved[0]),
        moved_rank=float(moved[1]),
        moved_paper=float(moved[2]),
        moved_nearest=float(moved[3]),
        traced=Errors(relative=errors[0].tolist()),
        tabulated=Errors(relative=errors[1].tolist()),
        tracer=Errors(relative=errors[2].tolist()),
        sky=sky,
        transmittance_mean_difference=float(differences.mean()),
        transmittance_uncertainty=uncertainty,
        split_difference=split_difference,
    )


def _tell(progress: Callable[[int, int], None] | None, done: int) -> None:
    if progress is not None:
        progress(done, STAGES)


def _exits(fenestration: TracedFenestration, step_deg: float) -> tuple[Float64, list[Exits]]:
    """Incident directions (N, 3) of a grid, and the light that each sends on."""
    incident = incident_grid(step_deg)
    sweep = fenestration.geometry.sweep(incident, TABLE_RAYS, seed=3)
    first = np.searchsorted(sweep.incidence, np.arange(len(incident) + 1))
    directions, flux = sweep.transmitted.directions, sweep.transmitted.flux
    return incident, [Exits(directions[a:b], flux[a:b]) for a, b in itertools.pairwise(first)]


def _represented(exits: Exits) -> Float64:
    """Share of the light in the first cones, by width and count."""
    shares = np.zeros((len(WIDTHS_DEG), len(COUNTS)))
    for row, width in enumerate(WIDTHS_DEG):
        lobes = greedy_split(exits.directions, exits.flux, PANEL_BINS, COUNTS[-1], math.radians(width)).lobes
        held = np.cumsum([lobe.share for lobe in lobes])
        shares[row] = [held[min(count, len(held)) - 1] / exits.total for count in COUNTS]
    return shares


def _left_out(incident: Float64, exits: list[Exits], every: int) -> Float64:
    """Each of some directions is left out in turn: the share of their light that is put elsewhere (4,), by our lobes;
    by the same lobes in rank; by the paper's three cones in rank; by the nearest direction's light."""
    tight = [split(light.directions, light.flux, PANEL_BINS) for light in exits]
    wide = [greedy_split(light.directions, light.flux, PANEL_BINS) for light in exits]
    moved, total = np.zeros(4), 0.0
    for left in np.flatnonzero(incident[:, 2] > math.cos(math.radians(MAXIMUM_POLAR_DEG)))[1::every]:
        kept = np.delete(np.arange(len(incident)), left)
        truth = (exits[left].directions, exits[left].flux)
        predictions: list[SunThrough] = []
        for through, is_by_rank in ((tight, False), (tight, True), (wide, True)):
            table = LobeTable(incident[kept], [through[k] for k in kept], PANEL_BINS, is_by_rank)
            predictions.append(table.at(incident[left]))
        predictions.append(tight[kept[int(np.argmax(incident[kept] @ incident[left]))]])
        if exits[left].total > 0:
            shares = [moved_share(as_points(prediction, PANEL_BINS), truth) for prediction in predictions]
            moved += exits[left].total * np.array(shares)
            total += exits[left].total
    return moved / max(total, 1e-300)


def _room_errors(fenestration: TracedFenestration, rays: int) -> tuple[Float64, Float64, float, float]:
    """Relative errors (3, suns, targets) of lobes at the sun, of lobes from a table, and of the tracer alone; the
    differences of transmittance (suns,), the second tracer's standard error of their mean, and the largest difference
    between lobes + residual and the rays that were split."""
    bins = bin_landing(PANEL_BINS)
    dark = DARK * float(illuminance(np.zeros(len(TARGETS)), 1.0)[0])
    incident, exits = _exits(fenestration, FINE_STEP_DEG)
    table = LobeTable(incident, [split(light.directions, light.flux, PANEL_BINS) for light in exits], PANEL_BINS)
    suns = sun_directions()
    errors = np.zeros((3, len(suns), len(TARGETS)))
    differences, spread, split_difference = np.zeros(len(suns)), np.zeros(len(suns)), 0.0
    for row, sun in enumerate(suns):
        halves = [_independent(fenestration, sun, rays // 2, seed=100 + 2 * row + half) for half in (0, 1)]
        directions = np.concatenate([half.directions for half in halves])
        flux = np.concatenate([half.flux for half in halves]) / 2
        truth = illuminance(landed(directions, flux), float(flux.sum()))
        through, own = fenestration.sun(sun), fenestration.exits(sun)
        between = table.at(sun)
        for which, (direct, total) in enumerate(
            (
                (landed_represented(through, bins), through.total),
                (landed_represented(between, bins), between.total),
                (landed(own.directions, own.flux), own.total),
            )
        ):
            errors[which, row] = (illuminance(direct, total) - truth) / np.maximum(truth, dark)
        differences[row] = through.total - float(flux.sum())
        spread[row] = (halves[0].total - halves[1].total) / 2
        split_difference = max(split_difference, abs(through.total - own.total))
    uncertainty = float(np.sqrt((spread**2).sum())) / len(suns)
    return errors, differences, uncertainty, split_difference


def _independent(fenestration: TracedFenestration, sun: Float64, rays: int, seed: int) -> Exits:
    """Light of another tracer; of unit cells, which it does not know, of other and more rays. More for diffuse light,
    fewer where curved glass guides it far."""
    if isinstance(fenestration.geometry, Section):
        lines = fenestration.geometry.lines
        is_diffuse = any(line.kind == "diffuse" for line in lines)
        is_curved = any(line.bow for line in lines) and any(line.kind == "interface" for line in lines)
        rays = rays * 16 if is_diffuse else rays // 8 if is_curved else rays
        return trace_paths(fenestration.geometry, sun, rays, seed).transmitted
    return fenestration.geometry.trace(sun, 16 * rays, seed).transmitted


DARK = 0.01
"""Errors are relative to at least so much of the interreflected light behind a panel that transmits everything: where
next to nothing is transmitted, a ratio says nothing."""

SKY_SUN = 10
"""Of the suns, the one under which the clear sky stands: an equinox morning."""

GROUND_REFLECTANCE = 0.2


def _sky_errors(fenestration: TracedFenestration) -> Float64:
    """Relative errors (targets,) under CIE sky 12 and an even ground: by the matrix between bins, against rays from
    directions of another and finer set, none of them binned."""
    sun = sun_directions()[SKY_SUN]
    rng = np.random.default_rng(12)
    side = 72
    u, v = (np.indices((side, side)) + rng.random((2, side, side))) / side
    sine, phi = np.sqrt(u.ravel()), 2 * np.pi * v.ravel()
    fine = np.stack([sine * np.cos(phi), sine * np.sin(phi), np.sqrt(1 - sine**2)], axis=1)
    lit = _sky_luminance(fine, sun) * (np.pi / len(fine))
    sweep = fenestration.geometry.sweep(fine, 8, seed=77)
    flux = sweep.transmitted.flux * lit[sweep.incidence]
    truth = illuminance(landed(sweep.transmitted.directions, flux), float(flux.sum()))

    basis = fenestration.basis
    own = np.bincount(basis.bin_of(fine), lit, basis.count)
    leaving = (fenestration.transmission() @ own) * basis.projected_solid_angles
    found = illuminance(leaving @ bin_landing(basis), float(leaving.sum()))
    return np.asarray(found / truth - 1)


def _sky_luminance(propagation: Float64, sun: Float64) -> Float64:
    """Relative luminance of sky and ground towards directions of propagation (N, 3) of the panel's frame."""
    sky = CieSky(12)
    up = -propagation[:, 1]
    value = sky.relative_luminance(np.maximum(up, 0.01), propagation @ sun)
    horizontal = float(np.mean(value[up > 0])) * math.pi
    return np.where(up > 0, value, GROUND_REFLECTANCE * horizontal / math.pi)


LATITUDE_DEG = 42.0
DECLINATIONS_DEG = (-23.44, 0.0, 23.44)
HOUR_ANGLES_DEG = (-52.5, -37.5, -22.5, -7.5, 7.5, 22.5, 37.5, 52.5)


def sun_directions() -> Float64:
    """24 directions of propagation (24, 3) in the frame of a south window at 42 degrees north: eight hours of the
    solstices and an equinox."""
    declination, hour = (np.radians(a).ravel() for a in np.meshgrid(DECLINATIONS_DEG, HOUR_ANGLES_DEG, indexing="ij"))
    latitude = math.radians(LATITUDE_DEG)
    up = math.sin(latitude) * np.sin(declination) + math.cos(latitude) * np.cos(declination) * np.cos(hour)
    south = math.sin(latitude) * np.cos(declination) * np.cos(hour) - math.cos(latitude) * np.sin(declination)
    west = np.cos(declination) * np.sin(hour)
    return np.stack([-west, -up, south], axis=1)
