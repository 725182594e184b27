"""The engine from Python: solve a scene once, relight it for any condition, look at it or measure it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from transom import _engine
from transom.daylight.condition import Condition
from transom.daylight.environment import dome_image
from transom.daylight.sky_bins import SkyBins
from transom.daylight.sun_disc import Sun, SunPlan, plan_sun
from transom.engine_scene import (
    EngineSky,
    engine_condition,
    engine_geometry,
    fenestration_of,
    what_else_changed,
)
from transom.errors import InputError
from transom.fenestration.light import panel_light
from transom.fenestration.panels import panel_groups
from transom.scene.model import Scene, View

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Visibility = Literal["rays", "volumes"]
Method = Literal["gather", "classic"]

SKY_PICTURE_HEIGHT = 64
"""Rows, from zenith to horizon, of the picture of the sky that is seen through openings."""

SKY_SUBDIVISION = 4
"""Reinhart's MF: 2305 bins. Coarser bins blur the sun's surroundings in a clear sky."""


@dataclass(frozen=True)
class SolveOptions:
    """Settings of a solve; the defaults serve every scene.

    method: "gather" (light gathered at nodes), or "classic", the published method: forward rays from sun and sky,
    constant patches, progressive shooting [Cutler et al. 2008].
    maximum_edge_m: of a patch [m]; 0 chooses it from target_patch_count. elements_per_edge: a patch has its square.
    patch_rays, patch_opening_rays: rays a patch, over the hemisphere and towards the openings; node_*: the same for
    each point at which light is shown (a node). panel_rays: rays from each panel of a glazing product outwards, for
    each of its incident bins. node_tolerance: relative error of interpolated light from which on nodes are added;
    smaller values put more of them into corners and under furniture. tolerance: relative flux in flight at which
    interreflection stops. seed: of all samples.
    """

    method: Method = "gather"
    maximum_edge_m: float = 0.0
    target_patch_count: int = 3000
    elements_per_edge: int = 4
    patch_rays: int = 512
    patch_opening_rays: int = 128
    node_rays: int = 1024
    node_opening_rays: int = 384
    panel_rays: int = 256
    node_tolerance: float = 0.054
    tolerance: float = 2.5e-4
    seed: int = 1


@dataclass(frozen=True)
class Frame:
    """A picture (height, width, 3), linear RGB whose Y is cd/m², and its parts, which add up to it.

    pass_count: passes of the stencil volumes; 0 by rays. 1 + 2 for each beam and plane of openings, less those that
    carry nothing.
    """

    radiance: Float32
    components: Mapping[str, Float32]
    edge_pixel_count: int
    pass_count: int = 0


@dataclass(frozen=True)
class EnergyAudit:
    """Flux balance of the rooms [lm], linear RGB (3,) each: what came in, sampled independently, and where it went."""

    in_sky: Float64
    in_beams: Float64
    in_reflected: Float64
    in_emitted: Float64
    absorbed: Float64
    out: Float64

    @property
    def imbalance(self) -> float:
        """(absorbed + out - in) / in, summed over the channels; 0 in a scene without light."""
        total_in = float((self.in_sky + self.in_beams + self.in_reflected + self.in_emitted).sum())
        return (float((self.absorbed + self.out).sum()) - total_in) / total_in if total_in > 0 else 0.0


@dataclass
class Engine:
    """A solved scene. Make one with `Engine.solve`; `relight` before looking."""

    scene: Scene
    options: SolveOptions
    sky: EngineSky = field(repr=False)
    _core: _engine.Engine = field(repr=False)
    condition: Condition | None = None
    present_sun: SunPlan = field(default_factory=SunPlan)
    _seen_sky: tuple[Condition, _engine.SkyPicture] | None = field(default=None, repr=False)

    @classmethod
    def solve(cls, scene: Scene, options: SolveOptions | None = None, *, trace: bool = False) -> Self:
        """All that depends on geometry and reflectance alone. Raises InputError for a room that is not closed."""
        options = options or SolveOptions()
        sky_bins = SkyBins(SKY_SUBDIVISION)
        try:
            core = _engine.Engine(engine_geometry(scene), _core_bins(sky_bins), _core_options(options, trace))
        except _engine.EngineInputError as error:
            raise InputError(_with_object_names(str(error), scene), file=scene.file) from None
        engine = cls(scene, options, EngineSky(sky_bins), core)
        engine._set_products()
        return engine

    def edited(self, scene: Scene) -> Self:
        """An engine for the edited scene: equal to a fresh solve with this one's options, and faster.

        What the edit leaves valid is taken over (`facts()["kept"]`): a reflectance or a luminance costs no ray, glazing
        or a closed opening only rays through openings, an object moved, added or removed those that may meet it, while
        the extent of the scene remains. transom.edits makes such scenes. This engine stays as it is. The new one has no
        light yet. Raises InputError for a room that is not closed.
        """
        try:
            core = _engine.Engine(self._core, engine_geometry(scene))
        except _engine.EngineInputError as error:
            raise InputError(_with_object_names(str(error), scene), file=scene.file) from None
        engine = type(self)(scene, self.options, self.sky, core)
        engine._set_products()
        return engine

    def relight(self, condition: Condition, sun: Sun = 1) -> None:
        """Finds the light of a condition; the geometry is not looked at again.

        sun: sub-suns that stand for its disc in pictures and at sensors, 1 for a point, or "auto" for as many as the
        scene asks for (`sun_plan`). Indirect light is that of a point. Raises InputError for light that is negative or
        not finite, and for a number of sub-suns that there is not; the engine then keeps the light that it had.
        """
        core_condition, plan = self._core_condition(condition, sun)
        with self._input_errors(condition):
            self._core.relight(core_condition)
        self.condition, self.present_sun = condition, plan

    def replace_products(self, scene: Scene) -> None:
        """Takes the products of a scene that differs in nothing else (`reglazed`), without a new solve. Relight next.

        Raises InputError for a scene of which more has changed, such as clear glass for a product, or the bins of the
        product's directions; the engine then keeps the products that it had.
        """
        changed = what_else_changed(self.scene, scene)
        if changed:
            raise InputError(
                f"differs in its {changed}", file=scene.file, field="products", remedy="Solve the scene anew"
            )
        self.scene = scene
        self._set_products()
        self.condition = None

    def _set_products(self) -> None:
        for index, group in enumerate(panel_groups(self.scene)):
            fenestration = fenestration_of(self.scene, group.opening)
            self._core.set_product(
                len(self.scene.openings) + index,
                np.ascontiguousarray(fenestration.transmission(), dtype=np.float32),
                fenestration.room_reflectance(),
            )

    @contextmanager
    def relighting(self) -> Iterator[Relighting]:
        """A `with` block in which light is found on a thread of its own while this one draws.

        with engine.relighting() as relighting:
            relighting.begin(condition)
            while not relighting.take():
                show(engine.render(view))
        """
        self._core.start_worker()
        try:
            yield Relighting(self)
        finally:
            self._core.stop_worker()

    @contextmanager
    def _input_errors(self, condition: Condition) -> Iterator[None]:
        """The engine's errors about a condition, with the condition's place."""
        try:
            yield
        except _engine.EngineInputError as error:
            raise InputError(str(error), file=self.scene.file, field=f"conditions.{condition.name}") from None

    def sun_plan(self, condition: Condition) -> SunPlan:
        """How many sub-suns the scene asks for under a condition's sun: as few as err by TOLERANCE of the sun's mean
        illuminance at places indoors. 1, a point, behind plain windows; more behind louvres."""
        if condition.sun_direction is None:
            return SunPlan()
        x, y, z = condition.sun_direction.tolist()
        points, weights = self._core.places_facing((x, y, z))
        return plan_sun(
            condition.sun_direction,
            lambda directions, places: self._core.shares_from(points[places], directions.astype(np.float32)),
            weights,
        )

    def _core_condition(self, condition: Condition, sun: Sun) -> tuple[_engine.Condition, SunPlan]:
        plan = self.sun_plan(condition) if sun == "auto" else SunPlan(1 if condition.sun_direction is None else sun)
        return engine_condition(self.scene, condition, self.sky, plan.sub_suns), plan

    def render(
        self, view: View, visibility: Visibility = "rays", *, edge_samples: int = 4, components: bool = True
    ) -> Frame:
        """The present light from a camera. visibility: sun by shadow rays or by stencil shadow volumes.

        edge_samples: samples a pixel and axis where an edge crosses a pixel, of a surface or of a beam; a grid twice as
        fine says how much of the pixel each side has. 1: pixel centres only. components: False leaves
        `Frame.components` empty, which is faster. A further picture of the last view, under whatever light, is
        several times as fast as the first: what the camera sees is kept.
        """
        method = _engine.Visibility.VOLUMES if visibility == "volumes" else _engine.Visibility.RAYS
        try:
            result = self._core.render(_core_view(view), method, edge_samples, components, self._sky_picture())
        except _engine.EngineInputError as error:
            raise InputError(str(error), file=self.scene.file, field=f"views.{view.name}") from None
        names = ("sun", "sky", "indirect", "emitted", "exterior") if components else ()
        return Frame(
            result["radiance"], {name: result[name] for name in names}, result["edge_pixel_count"], result["pass_count"]
        )

    def illuminance(
        self, points: Float64, normals: Float64, *, rays: int = 16384, opening_rays: int = 8192
    ) -> dict[str, Float64]:
        """Illuminance at points (N, 3) [m] with unit normals (N, 3): "direct", "sky", "indirect" and "total".

        Each (N, 3), linear RGB whose Y is lux. rays, opening_rays: samples a point.
        Raises InputError for a point that is not finite or a normal without a direction.
        """
        self._require_light()
        _check_sensors(points, normals, self.scene)
        parts = self._core.illuminance(
            np.ascontiguousarray(points, dtype=np.float64),
            np.ascontiguousarray(normals, dtype=np.float32),
            _engine.GatherSamples(rays, opening_rays),
        ).astype(np.float64)
        return {
            "direct": parts[:, 0],
            "sky": parts[:, 1],
            "indirect": parts[:, 2],
            "total": parts.sum(axis=1),
        }

    def audit(self, rays_per_opening: int = 65536) -> EnergyAudit:
        """Flux balance of the rooms; what enters is sampled from the openings with rays of its own."""
        self._require_light()
        parts = self._core.audit(rays_per_opening)
        return EnergyAudit(**{name: np.array(value) for name, value in parts.items()})

    def facts(self) -> dict[str, Any]:
        """What the solve found and did: counts, the edge chosen, leaks, and how far form factors were off at first."""
        facts, defects = self._core.facts, self._core.facts.defects
        return {
            "faces": facts.face_count,
            "patches": facts.patch_count,
            "interior_patches": facts.interior_patch_count,
            "nodes": facts.node_count,
            "maximum_edge_m": facts.maximum_edge_m,
            "leak_share": facts.leak_share,
            "clusters": facts.cluster_count,
            "link_bytes": facts.link_bytes,
            "kept": {"patch_rows": facts.kept_patch_rows, "node_rows": facts.kept_node_rows},
            "panels": facts.panel_count,
            "panel_bins": facts.panel_bin_count,
            "form_factor_defects": {
                "raw_reciprocity": defects.raw_reciprocity,
                "raw_row_sum": defects.raw_row_sum,
                "row_sum": defects.row_sum,
                "reciprocity": defects.reciprocity,
                "scalings": defects.iterations,
            },
        }

    def plan(self) -> dict[str, int]:
        """What the present light took: channels (1 where scene and light are grey), beams that reach anything, opening
        faces that face them, patches that their light might reach, and 1 for unshaded where the room is convex, so that
        nothing can shade these; 0 beams under an overcast sky."""
        return {name: int(count) for name, count in self._core.plan.items()}

    def form_factors(self) -> tuple[NDArray[np.int64], NDArray[np.int32], Float32, Float32]:
        """Form factors between patches as compressed sparse rows: begin, column, value; and patch areas [m²]."""
        begin, column, value = self._core.form_factors
        return begin, column, value, self._core.patch_areas

    def trace(self) -> list[tuple[str, float, float]]:
        """Phases recorded so far as (name, begin, end) [s]; empty unless solved with trace=True."""
        return list(self._core.trace)

    @property
    def lobe_count(self) -> int:
        """Lobes of products in the present condition, over all panel groups that the sun shines on."""
        if self.condition is None:
            return 0
        return sum(len(light.beams) for light in panel_light(self.scene, self.condition))

    @property
    def sweeps(self) -> int:
        """Cycles of interreflection of the last relighting."""
        return int(self._core.sweeps)

    @property
    def shots(self) -> int:
        """Classic method: how often patches shot in the last relighting."""
        return int(self._core.shots)

    @property
    def forward_rays(self) -> int:
        """Classic method: rays cast from sun, sky and ground in the last relighting."""
        return int(self._core.forward_rays)

    def _sky_picture(self) -> _engine.SkyPicture:
        """Of the present condition, whose light does not need it: made when it is looked at, and kept."""
        condition = self._require_light()
        if self._seen_sky is None or self._seen_sky[0] is not condition:
            self._seen_sky = condition, _engine.SkyPicture(dome_image(condition.sky, SKY_PICTURE_HEIGHT))
        return self._seen_sky[1]

    def _require_light(self) -> Condition:
        if self.condition is None:
            raise RuntimeError("relight the engine before looking at it")
        return self.condition


class Relighting:
    """Light that is being found beside other work. Made by `Engine.relighting`; used by the thread that draws."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._begun: dict[int, tuple[Condition, SunPlan]] = {}

    def begin(self, condition: Condition, sun: Sun = 1) -> None:
        """Asks for the light of a condition and returns at once; one that is still in work is abandoned.

        sun: as in `Engine.relight`. Raises InputError as that does; what is in work then goes on.
        """
        core_condition, plan = self._engine._core_condition(condition, sun)
        with self._engine._input_errors(condition):
            number = self._engine._core.submit(core_condition)
        self._begun[number] = condition, plan

    def take(self) -> bool:
        """Makes the newest state the engine's present light; whether it is the complete light of the newest condition.

        The first state of a condition has its beams and sky, with the indirect light of the one before it.
        """
        return self._taken(*self._engine._core.take_latest())

    def finish(self) -> None:
        """Waits for the complete light of the newest condition, and makes it the engine's present light."""
        self._taken(*self._engine._core.take_finished())

    def _taken(self, number: int, is_complete: bool) -> bool:
        if number in self._begun:
            self._engine.condition, self._engine.present_sun = self._begun[number]
            self._begun = {n: begun for n, begun in self._begun.items() if n >= number}
        return is_complete and number == max(self._begun, default=0)


def trace_primary(scene: Scene, view: View) -> tuple[NDArray[np.int32], Float32, NDArray[np.bool_]]:
    """What pixel centres see first: face (h, w), -1 for none; point (h, w, 3) [m]; whether it is an opaque surface."""
    face, position = _engine.trace_primary(engine_geometry(scene), _core_view(view))
    is_opaque_face = np.array([scene.materials[m].opening < 0 for m in scene.mesh.face_material])
    interior = (face >= 0) & is_opaque_face[np.maximum(face, 0)]
    return face, position.astype(np.float32), interior


def _check_sensors(points: Float64, normals: Float64, scene: Scene) -> None:
    usable = np.isfinite(points).all(axis=1) & np.isfinite(normals).all(axis=1)
    usable &= np.linalg.norm(normals, axis=1) > 0
    if usable.all():
        return
    index = int(np.flatnonzero(~usable)[0])
    raise InputError(
        f"with the normal {normals[index].tolist()} is not finite, or its normal has no direction",
        file=scene.file,
        field=f"sensor {index}",
        value=points[index].tolist(),
        remedy="Give finite coordinates and a normal such as [0, 0, 1]",
    )


@contextmanager
def thread_limit(count: int) -> Iterator[None]:
    """A `with` block in which the engine uses at most so many threads; its answers do not depend on them."""
    with _engine.ThreadLimit(count):
        yield


def build_description() -> str:
    """Compiler, flags and libraries of the compiled engine."""
    return str(_engine.build_description())


def _core_bins(bins: SkyBins) -> _engine.SkyBins:
    return _engine.SkyBins(bins.row_altitude_edges.astype(np.float32), np.asarray(bins.row_counts, dtype=np.int32))


def _core_options(options: SolveOptions, trace: bool) -> _engine.SolveOptions:
    core = _engine.SolveOptions()
    core.method = _engine.Method.CLASSIC if options.method == "classic" else _engine.Method.GATHER
    core.maximum_edge_m = options.maximum_edge_m
    core.target_patch_count = options.target_patch_count
    core.elements_per_edge = options.elements_per_edge
    core.patch_samples = _engine.GatherSamples(options.patch_rays, options.patch_opening_rays)
    core.node_samples = _engine.GatherSamples(options.node_rays, options.node_opening_rays)
    core.panel_rays = options.panel_rays
    core.node_tolerance = options.node_tolerance
    core.tolerance = options.tolerance
    core.seed = options.seed
    core.trace = trace
    return core


def _core_view(view: View) -> _engine.View:
    return _engine.View(view.position, view.target, view.up, view.vertical_fov_rad, view.width, view.height)


def _with_object_names(text: str, scene: Scene) -> str:
    """The engine's message, with the scene's own names for the faces and the material that it numbers."""
    names = []
    for face in dict.fromkeys(int(number) for number in re.findall(r"\bface (\d+)", text)):
        material = scene.materials[int(scene.mesh.face_material[face])].name
        owner = scene.mesh.objects[scene.mesh.face_object[face]]
        names.append(f"face {face} belongs to object {owner!r}, material {material!r}")
    materials = dict.fromkeys(int(number) for number in re.findall(r"\bmaterial (\d+)", text))
    names += [f"material {index} is {scene.materials[index].name!r}" for index in materials]
    return f"{text} ({'; '.join(names)})" if names else text
