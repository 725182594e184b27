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
from transom.daylight.sky_bins import SkyBins
from transom.errors import InputError
from transom.glass import diffuse_reflectance, transmittance_table
from transom.scene.model import Scene, View

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Visibility = Literal["rays", "volumes"]
Method = Literal["gather", "classic"]

SKY_SUBDIVISION = 4
"""Reinhart's MF: 2305 bins. Coarser bins blur the sun's surroundings in a clear sky."""

SKY_PICTURE_HEIGHT = 128
"""Rows of the sky picture that is seen through openings."""


@dataclass(frozen=True)
class SolveOptions:
    """Settings of a solve; the defaults serve every scene.

    method: "gather" (light gathered at nodes), or "classic", the published method: forward rays from sun and sky,
    constant patches, progressive shooting [Cutler et al. 2008].
    maximum_edge_m: of a patch [m]; 0 chooses it from target_patch_count. elements_per_edge: a patch has its square.
    patch_rays, patch_opening_rays: rays a patch, over the hemisphere and towards the openings; node_*: the same for
    each point at which light is shown (a node). node_tolerance: relative error of interpolated light from which on
    nodes are added; smaller values put more of them into corners and under furniture. tolerance: relative flux in
    flight at which interreflection stops. seed: of all samples.
    """

    method: Method = "gather"
    maximum_edge_m: float = 0.0
    target_patch_count: int = 3000
    elements_per_edge: int = 4
    patch_rays: int = 512
    patch_opening_rays: int = 128
    node_rays: int = 1024
    node_opening_rays: int = 256
    node_tolerance: float = 0.06
    tolerance: float = 1e-4
    seed: int = 1


@dataclass(frozen=True)
class Frame:
    """A picture (height, width, 3), linear RGB whose Y is cd/m², and its parts, which add up to it."""

    radiance: Float32
    components: Mapping[str, Float32]
    edge_pixel_count: int


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
    sky_bins: SkyBins
    _core: _engine.Engine = field(repr=False)
    condition: Condition | None = None

    @classmethod
    def solve(cls, scene: Scene, options: SolveOptions | None = None, *, trace: bool = False) -> Self:
        """All that depends on geometry and reflectance alone. Raises InputError for a room that is not closed."""
        options = options or SolveOptions()
        sky_bins = SkyBins(SKY_SUBDIVISION)
        try:
            core = _engine.Engine(_geometry(scene), _core_bins(sky_bins), _core_options(options, trace))
        except _engine.EngineInputError as error:
            raise InputError(_with_object_names(str(error), scene), file=scene.file) from None
        return cls(scene, options, sky_bins, core)

    def relight(self, condition: Condition) -> None:
        """Finds the light of a condition; the geometry is not looked at again.

        Raises InputError for light that is negative or not finite; the engine then keeps the light that it had.
        """
        core_condition = self._core_condition(condition)
        with self._input_errors(condition):
            self._core.relight(core_condition)
        self.condition = condition

    def relight_in_steps(self, condition: Condition, shots: int = 64) -> Iterator[float]:
        """Classic method: new direct light at once, then the old indirect light replaced, `shots` patches at a time.

        Yields the share of flux still in flight; after each, `render` and `illuminance` show a usable state. Left
        early, the next relighting goes on from there. Raises InputError for another method.
        """
        if self.options.method != "classic":
            remedy = 'Solve with method "classic"'
            raise InputError("cannot relight in steps", field="method", value=self.options.method, remedy=remedy)
        core_condition = self._core_condition(condition)
        with self._input_errors(condition):
            self._core.begin_relight(core_condition)
        self.condition = condition
        more = True
        while more:
            yield float(self._core.unshot_share)
            more = self._core.continue_relight(shots)
        yield float(self._core.unshot_share)

    @contextmanager
    def _input_errors(self, condition: Condition) -> Iterator[None]:
        """The engine's errors about a condition, with the condition's place."""
        try:
            yield
        except _engine.EngineInputError as error:
            raise InputError(str(error), file=self.scene.file, field=f"conditions.{condition.name}") from None

    def _core_condition(self, condition: Condition) -> _engine.Condition:
        sky_picture = condition.environment_image(SKY_PICTURE_HEIGHT)
        core_condition = _engine.Condition(
            condition.bin_luminance(self.sky_bins).astype(np.float32),
            _triple(condition.sky_rgb),
            _triple(condition.ground_luminance_rgb),
            np.ascontiguousarray(sky_picture, dtype=np.float32),
        )
        if condition.sun_direction is not None:
            core_condition.add_beam(_triple(condition.sun_direction), _triple(condition.sun_illuminance_rgb))
        return core_condition

    def render(
        self, view: View, visibility: Visibility = "rays", *, edge_samples: int = 4, components: bool = True
    ) -> Frame:
        """The present light from a camera. visibility: sun by shadow rays or by stencil shadow volumes.

        edge_samples: samples a pixel and axis where an edge crosses a pixel; 1: pixel centres only. components: False
        leaves `Frame.components` empty, which is faster. A further picture of the last view, under whatever light, is
        several times as fast as the first: what the camera sees is kept.
        """
        self._require_light()
        method = _engine.Visibility.VOLUMES if visibility == "volumes" else _engine.Visibility.RAYS
        try:
            result = self._core.render(_core_view(view), method, edge_samples, components)
        except _engine.EngineInputError as error:
            raise InputError(str(error), file=self.scene.file, field=f"views.{view.name}") from None
        names = ("sun", "sky", "indirect", "emitted", "exterior") if components else ()
        return Frame(result["radiance"], {name: result[name] for name in names}, result["edge_pixel_count"])

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
            "form_factor_defects": {
                "raw_reciprocity": defects.raw_reciprocity,
                "raw_row_sum": defects.raw_row_sum,
                "row_sum": defects.row_sum,
                "reciprocity": defects.reciprocity,
                "scalings": defects.iterations,
            },
        }

    def form_factors(self) -> tuple[NDArray[np.int64], NDArray[np.int32], Float32, Float32]:
        """Form factors between patches as compressed sparse rows: begin, column, value; and patch areas [m²]."""
        begin, column, value = self._core.form_factors
        return begin, column, value, self._core.patch_areas

    def trace(self) -> list[tuple[str, float, float]]:
        """Phases recorded so far as (name, begin, end) [s]; empty unless solved with trace=True."""
        return list(self._core.trace)

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

    def _require_light(self) -> None:
        if self.condition is None:
            raise RuntimeError("relight the engine before looking at it")


def trace_primary(scene: Scene, view: View) -> tuple[NDArray[np.int32], Float32, NDArray[np.bool_]]:
    """What pixel centres see first: face (h, w), -1 for none; point (h, w, 3) [m]; whether it is an opaque surface."""
    face, position = _engine.trace_primary(_geometry(scene), _core_view(view))
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


def _triple(vector: Float64) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in vector)
    return x, y, z


def _geometry(scene: Scene) -> _engine.SceneGeometry:
    mesh = scene.mesh
    normals = np.zeros((0, 3)) if mesh.corner_normals is None else mesh.corner_normals.reshape(-1, 3)
    geometry = _engine.SceneGeometry(
        np.ascontiguousarray(mesh.vertices, dtype=np.float64),
        np.ascontiguousarray(mesh.faces, dtype=np.int32),
        np.ascontiguousarray(mesh.face_material, dtype=np.int32),
        np.ascontiguousarray(normals, dtype=np.float32),
    )
    for material in scene.materials:
        geometry.add_material(material.reflectance, material.luminance, material.smooth, material.opening)
    for opening in scene.openings:
        geometry.add_opening(transmittance_table(opening), diffuse_reflectance(opening))
    for source in scene.point_sources:
        geometry.add_point_source(source.position, source.intensity)
    return geometry


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
