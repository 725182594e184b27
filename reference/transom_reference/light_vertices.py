"""Light paths from the openings into the room: where they land is light that camera paths can be connected to.

A light path starts at an opening with the sun's beam, or with whatever arrives there from outside in a random
direction (sky, ground, or outdoor surfaces, found by the path tracer), and is reflected diffusely, by glass too, until
it dies or leaves through a pane. Each landing is a light vertex, except the sun's first one, which is a sun patch.
[Keller 1997, Instant radiosity; Davidovič et al. 2014, Progressive light transport simulation: light vertex cache]
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from transom_reference.light_along import LightAlong
from transom_reference.low_discrepancy import lane_seed, pair
from transom_reference.mitsuba_setup import dr, floats, mi, points
from transom_reference.panels import outward_direction, panel_side
from transom_reference.sun_patches import morton, portal_starts
from transom_reference.surface import gather4, offset, surface_at
from transom_reference.transport_scene import TransportScene

PATH_COUNT = 1 << 16
"""Light paths of one batch."""

CAPACITY = 16 * PATH_COUNT
"""Most light vertices of one batch: a mean of 16 landings is reached by a room of reflectance 0.94."""

PILOT_SEED = 0xF00D
SHARE = 20.0
"""How much of the light is taken from connections: they get the weight of a density of SHARE / room area."""

Arriving = Callable[[Any, Any, int], Any]
"""Radiance that arrives at points from directions: (origins, directions, seed) -> RGB by lane."""


@dataclass(frozen=True)
class LightVertices:
    """The light vertices of one batch, in Morton order of place, so that near entries are alike.

    table: flat (count, 12): place, 0; normal, 0; radiance x area rgb [cd], 0. count: number of them.
    """

    table: Any
    count: Any

    @classmethod
    def trace(cls, scene: TransportScene, light: LightAlong, arriving: Arriving, seed: int) -> LightVertices:
        table = _sorted(_landings(scene, light, arriving, seed))
        if len(table) == 0:
            table = np.zeros((1, 12), dtype=np.float32)
        return cls(floats(table), dr.opaque(mi.UInt32, len(table)))

    def choose(self, choice: Any, active: Any) -> tuple[Any, Any, Any]:
        """Place, normal and radiance x area, times the number of vertices, of a random one."""
        index = dr.minimum(mi.UInt32(choice * mi.Float(self.count)), self.count - 1) * 3
        place = gather4(self.table, index, active)
        normal = gather4(self.table, index + 1, active)
        power = gather4(self.table, index + 2, active)
        return mi.Point3f(place.xyz), mi.Normal3f(normal.xyz), mi.Color3f(power.xyz) * mi.Float(self.count)


def connection_density(scene: TransportScene, light: LightAlong, arriving: Arriving) -> float:
    """Area density [1/m²] that weights connections against rays: SHARE over the area of the landings' bounding box."""
    table = _landings(scene, light, arriving, PILOT_SEED)
    if len(table) == 0:
        return 0.0
    low, high = np.percentile(table[:, :3], [0.1, 99.9], axis=0)
    x, y, z = np.maximum(high - low, 1e-3)
    return float(SHARE / (2 * (x * y + y * z + z * x)))


def _landings(scene: TransportScene, light: LightAlong, arriving: Arriving, seed: int) -> Any:
    """Rows (count, 12) of light vertices in no particular order."""
    origin, direction, flux, is_sun = _starts(scene, light, arriving, seed)
    count = dr.width(origin)
    usual = float(np.array(dr.mean(dr.max(flux)))[0])
    if usual <= 0.0:
        return np.zeros((0, 12), dtype=np.float32)
    usual_flux = dr.opaque(mi.Float, usual)
    lanes = lane_seed(dr.arange(mi.UInt32, count), dr.opaque(mi.UInt32, (seed ^ 0x9E3779B9) & 0xFFFFFFFF))
    buffer = dr.zeros(mi.Float, CAPACITY * 12)
    counter = dr.zeros(mi.UInt32, 1)

    def step(active: Any, origin: Any, direction: Any, flux: Any, bounce: Any) -> tuple[Any, ...]:
        found = scene.all.ray_intersect_preliminary(mi.Ray3f(origin, direction), active=active)
        hit = active & found.is_valid()
        surface = surface_at(scene, found, direction, hit)
        is_glass = surface.opening >= 0.0
        hit &= ~is_glass | (surface.along > 0.0)
        reflectance = dr.select(is_glass, mi.Color3f(surface.room), surface.reflectance)
        # Radiance uses the shading normal for the arriving light, flux per area the true one [Veach 1997, 5.3.2].
        turn = dr.maximum(-dr.dot(surface.shading, direction), 0.0) / dr.maximum(dr.abs(surface.along), 1e-4)
        leaving = flux * reflectance * turn
        place = offset(surface.point, surface.normal)
        kept = hit & ~(is_sun & (bounce == 0)) & (dr.max(leaving) > 0.0)
        slot = dr.scatter_inc(counter, mi.UInt32(0), kept)
        kept &= slot < CAPACITY
        power = leaving * float(1 / np.pi)
        for column, value in enumerate([*place, mi.Float(0.0), *surface.normal, mi.Float(0.0), *power]):
            dr.scatter(buffer, value, slot * 12 + column, kept)
        survival = dr.minimum(1.0, dr.max(leaving) / usual_flux)
        first, second = pair(lanes, bounce * 2, mi.UInt32(0), 0)
        chance, _ = pair(lanes, bounce * 2 + 1, mi.UInt32(0), 0)
        onward = mi.Frame3f(surface.normal).to_world(mi.warp.square_to_cosine_hemisphere(mi.Point2f(first, second)))
        active = hit & (chance < survival) & (bounce < 1000)
        return active, place, mi.Vector3f(onward), leaving / dr.maximum(survival, 1e-12), bounce + 1

    state = (dr.max(flux) > 0.0, mi.Point3f(origin), mi.Vector3f(direction), flux, dr.zeros(mi.UInt32, count))
    state = dr.while_loop(state, lambda active, *_: active, step, label="light paths")
    dr.eval(state, buffer, counter)
    stored = int(np.array(counter)[0])
    if stored > CAPACITY:
        raise RuntimeError(f"{stored} light vertices, room for {CAPACITY}: reflectances too near 1 for light paths")
    return np.array(buffer).reshape(-1, 12)[:stored]


def _starts(scene: TransportScene, light: LightAlong, arriving: Arriving, seed: int) -> tuple[Any, Any, Any, Any]:
    """Origins, directions into the room, flux [lm, rgb] and whether it is the sun's, by lane."""
    areas = np.array([portal.area for portal in scene.portals])
    sky_flux = np.pi * areas * np.maximum(scene.portal_weights, 1e-3)
    sun_flux = scene.sun_starts_flux
    beam_flux = float(scene.sun_illuminance.max() * sun_flux.sum())
    sun_share = beam_flux / (beam_flux + sky_flux.sum())
    sun_count = int(np.clip(round(sun_share * PATH_COUNT), PATH_COUNT // 16, PATH_COUNT)) if sun_flux.any() else 0
    sky_count = max(PATH_COUNT - sun_count, PATH_COUNT // 16)
    generator = np.random.default_rng([seed & 0xFFFFFFFF, 0x51CE])

    normals = np.array([portal.normal for portal in scene.portals])
    start, portal = portal_starts(scene, sky_flux / sky_flux.sum(), sky_count, seed + 1)
    u, v = generator.random(sky_count), generator.random(sky_count)
    local = mi.warp.square_to_cosine_hemisphere(mi.Point2f(floats(u), floats(v)))
    chosen = mi.Normal3f(*points(normals[portal]))
    outward = mi.Vector3f(mi.Frame3f(chosen).to_world(local))
    place = mi.Point3f(*points(start))
    weight = np.pi * areas * sky_flux.sum() / (sky_flux * sky_count)
    opening = np.array([entry.opening for entry in scene.portals])
    passed = light.transmittance(mi.UInt32(floats(opening[portal])), local.z, True)
    if scene.panels is None:
        flux = arriving(offset(place, chosen), outward, seed) * passed * floats(weight[portal])
    else:
        side = panel_side(scene.panels, mi.UInt32(floats(portal)), outward, dr.full(mi.Bool, True, sky_count))
        numbers = floats(generator.random(sky_count)), floats(generator.random(sky_count))
        came_from = dr.select(side.active, outward_direction(scene.panels, side, *numbers), outward)
        radiance = arriving(offset(place, chosen), came_from, seed) * dr.select(side.active, side.share, passed)
        flux = (radiance + light.panel_sun(side, place, chosen)) * floats(weight[portal])
    origin, direction = offset(place, -chosen), -outward
    if sun_count == 0:
        return origin, direction, flux, mi.Bool(False)

    start, row = portal_starts(scene, scene.sun_starts_probability, sun_count, seed + 2)
    sun = mi.Vector3f(*map(float, scene.sun_direction))  # type: ignore[arg-type]
    dr.make_opaque(sun)
    chosen = mi.Normal3f(*points(normals[row % len(normals)]))
    place = mi.Point3f(*points(start))
    passed, _ = light.sun(offset(place, chosen), sun, dr.full(mi.Bool, True, sun_count))
    share = sun_flux / (np.maximum(scene.sun_starts_probability, 1e-30) * sun_count)
    colour = mi.Color3f(*map(float, scene.sun_illuminance))
    propagation = -sun
    if scene.panels is not None:
        propagation, colour = _beams_of(scene, row // len(scene.portals))
    sun_lane_flux = colour * passed * floats(share[row])
    dr.eval(origin, direction, flux, sun_lane_flux)
    sun_origin = offset(place, -chosen)
    is_sun = dr.concat([dr.full(mi.Bool, False, sky_count), dr.full(mi.Bool, True, sun_count)])
    together = [
        [dr.concat([a, b + dr.zeros(mi.Float, sun_count)]) for a, b in zip(one, two, strict=True)]
        for one, two in ((origin, sun_origin), (direction, propagation), (flux, sun_lane_flux))
    ]
    return mi.Point3f(*together[0]), mi.Vector3f(*together[1]), mi.Color3f(*together[2]), is_sun


def _beams_of(scene: TransportScene, number: Any) -> tuple[Any, Any]:
    """Direction of propagation and colour, as bright as the sun, of the straight sun (0) and of panel beams (1 ...)."""
    assert scene.panels is not None
    assert scene.sun_direction is not None
    beams = scene.panels.beams
    directions = np.stack([-scene.sun_direction, *(beam.direction for beam in beams)])
    level = scene.sun_illuminance.max()
    colours = np.stack([scene.sun_illuminance, *(beam.normal_rgb * level / beam.normal_rgb.max() for beam in beams)])
    return mi.Vector3f(*points(directions[number])), mi.Color3f(*points(colours[number]))


def _sorted(table: Any) -> Any:
    """In Morton order of place, so that a stratified choice of entries is stratified in space."""
    if len(table) == 0:
        return table
    low, high = table[:, :3].min(axis=0), table[:, :3].max(axis=0)
    scaled = (table[:, :3] - low) / np.maximum((high - low).max(), 1e-6)
    # The order in which threads stored them must not matter: ties are broken by the place itself.
    return table[np.lexsort((table[:, 2], table[:, 1], table[:, 0], morton(scaled)))]
