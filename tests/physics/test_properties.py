"""Laws that hold in every room: reciprocity, linearity in light, openings that add up, more light from paler walls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from transom.colour import luminance
from transom.daylight import resolve_condition
from transom.daylight.condition import Condition
from transom.engine import Engine, SolveOptions
from transom.hard.changes import sunlit
from transom.hard.rooms import Polygon, Room, as_point, box, quad, windowed_room
from transom.scene.model import Scene

FEW = SolveOptions(target_patch_count=100, patch_rays=256, patch_opening_rays=64, node_rays=32, node_opening_rays=32)
bounded = settings(
    max_examples=8,
    deadline=None,
    derandomize=True,
    phases=[Phase.explicit, Phase.generate],
    suppress_health_check=[HealthCheck.too_slow],
)

shares = st.floats(0.0, 0.95, allow_nan=False)
towards_sun = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, -0.1), st.floats(0.1, 1.0))


@st.composite
def rooms(draw: st.DrawFn, windows: int = 1) -> Room:
    """A room of any size with a box in it, and one or two unglazed holes side by side in its south wall."""
    size = draw(st.tuples(*(st.floats(2.0, 9.0) for _ in range(3))))
    reflectance = draw(shares)
    stretch = np.array(size) / np.array((4.0, 5.0, 3.0))
    base = windowed_room(transmittance=None, reflectance=reflectance)
    low = [draw(st.floats(0.6, 1.5)) for _ in range(3)]
    box_size = [draw(st.floats(0.2, 1.0)) for _ in range(3)]
    high = [a + b for a, b in zip(low, box_size, strict=True)]
    polygons = [*base.polygons[:-1], *_panes(base.polygons[-1], windows), *box(as_point(low), as_point(high))]
    stretched = tuple(
        replace(p, corners=tuple(as_point(stretch * np.array(corner)) for corner in p.corners)) for p in polygons
    )
    openings = {p.material: None for p in _panes(base.polygons[-1], windows)}
    sensors = [as_point(stretch * np.array(point)) for point in base.sensors]
    camera, target = (as_point(stretch * np.array(point)) for point in (base.camera, base.target))
    return replace(base, polygons=stretched, openings=openings, sensors=sensors, camera=camera, target=target)


def _panes(hole: Polygon, count: int) -> list[Polygon]:
    if count == 1:
        return [replace(hole, material="left")]
    (x0, z0), (x1, z1) = (1.0, 1.0), (3.0, 2.5)
    middle = 1.7
    return [
        quad((a, 0.0, z0), (b, 0.0, z0), (b, 0.0, z1), (a, 0.0, z1), name, "window")
        for a, b, name in ((x0, middle, "left"), (middle, x1, "right"))
    ]


def sky_and_sun(scene: Scene, towards: tuple[float, float, float], sky: float = 1.0, sun: float = 1.0) -> Condition:
    """The scene's own light, its sky and sun each made stronger by a factor."""
    lit = sunlit(resolve_condition(scene.conditions[0], scene.site), towards, 60000.0)
    return replace(
        lit,
        sky=replace(lit.sky, scale=sky * lit.sky.scale),
        ground_luminance_rgb=sky * lit.ground_luminance_rgb,
        sun_illuminance_rgb=sun * lit.sun_illuminance_rgb,
        sun_direction=lit.sun_direction if sun > 0 else None,
    )


def sensors_lx(engine: Engine, condition: Condition) -> NDArray[np.float64]:
    engine.relight(condition)
    (desk,) = engine.scene.sensors
    return np.asarray(luminance(engine.illuminance(desk.points, desk.normals, rays=4096, opening_rays=16384)["total"]))


@bounded
@given(rooms())
def test_form_factors_are_reciprocal_and_no_room_loses_or_makes_flux(room: Room) -> None:
    engine = Engine.solve(room.load(), FEW)
    begin, column, value, area = engine.form_factors()
    row = np.repeat(np.arange(len(area)), np.diff(begin))
    flux = np.zeros((len(area), len(area)))
    flux[row, column] = value * area[row]
    assert np.abs(flux - flux.T).max() <= 1e-5 * area.max()
    assert np.abs(flux.sum(axis=1) / area - 1)[: engine.facts()["interior_patches"]].max() < 1e-5
    assert value.min() >= 0


@bounded
@given(rooms(), towards_sun, st.floats(0.0, 4.0), st.floats(0.0, 4.0))
def test_light_is_linear_in_sky_and_sun(
    room: Room, towards: tuple[float, float, float], sky: float, sun: float
) -> None:
    """Except for single precision, and for interreflection that stops at 1e-6 of the flux."""
    scene = room.load()
    engine = Engine.solve(scene, FEW)
    of_sky = sensors_lx(engine, sky_and_sun(scene, towards, 1.0, 0.0))
    of_sun = sensors_lx(engine, sky_and_sun(scene, towards, 0.0, 1.0))
    both = sensors_lx(engine, sky_and_sun(scene, towards, sky, sun))
    np.testing.assert_allclose(both, sky * of_sky + sun * of_sun, rtol=1e-4, atol=1e-4 * (of_sky + of_sun).max())


@bounded
@given(rooms(windows=2), towards_sun)
def test_openings_add_up(room: Room, towards: tuple[float, float, float]) -> None:
    """Each hole filled with black in turn: a hole reflects nothing, so that what stays of the room is the same.

    Openings are sampled anew, with as many rays as before: 16,384 a point.
    """

    def of(open_ones: set[str]) -> NDArray[np.float64]:
        part = room.with_material("black", "reflectance = 0.0")
        part = replace(
            part,
            polygons=tuple(
                replace(p, material="black") if p.material in room.openings and p.material not in open_ones else p
                for p in room.polygons
            ),
            openings={name: None for name in room.openings if name in open_ones},
            materials=part.materials if len(open_ones) < len(room.openings) else room.materials,
        )
        scene = part.load()
        return sensors_lx(Engine.solve(scene, FEW), sky_and_sun(scene, towards))

    both, left, right = of({"left", "right"}), of({"left"}), of({"right"})
    np.testing.assert_allclose(both, left + right, rtol=0.02, atol=0.02 * both.max())


@bounded
@given(rooms(), towards_sun, shares, shares)
def test_paler_walls_never_make_a_place_darker(
    room: Room, towards: tuple[float, float, float], one: float, other: float
) -> None:
    scene = room.load()
    light = sky_and_sun(scene, towards)

    def of(rho: float) -> NDArray[np.float64]:
        grey = tuple(replace(m, reflectance=(rho,) * 3) if m.opening < 0 else m for m in scene.materials)
        return sensors_lx(Engine.solve(replace(scene, materials=grey), FEW), light)

    darker, paler = of(min(one, other)), of(max(one, other))
    assert np.all(paler >= darker * (1 - 1e-5))
