"""bench.json: every quantity with its samples and phases, over sizes; and what it is set against."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scene_writing import ROOM_OBJ, write_scene

from transom import machine_limits
from transom.bench import (
    SCHEMA_FILE,
    Bench,
    Point,
    bench_lines,
    bench_points,
    bench_scene,
    bench_schema,
    measure_point,
    read_bench,
    write_bench,
)
from transom.bench_scenes import (
    beam_count,
    has_changeable_product,
    movable_object,
    opening_face_count,
    scene_edits,
    target_for_patches,
    with_other_glass,
    with_other_product,
    with_panes,
)
from transom.cli import WRONG_USE, run_command
from transom.daylight.condition import resolve_condition
from transom.errors import InputError
from transom.fenestration.light import panel_light
from transom.fenestration.reglazing import load_glazed
from transom.machine_limits import Limit, memory_copy, utilisations
from transom.products import list_products, load_product
from transom.progress import CaseProgress
from transom.provenance import current_provenance
from transom.scene import content_key, load_scene
from transom.scene.model import Mesh, Scene


@pytest.fixture
def room(tmp_path: Path) -> Scene:
    return load_scene(write_scene(tmp_path / "room"))


def crate(name: str, low: tuple[float, float, float], size: float, number: int) -> str:
    """A closed cube as an object of a file whose room has eight vertices, and `number` cubes before this one."""
    corners = [(low[0] + size * (k & 1), low[1] + size * (k >> 1 & 1), low[2] + size * (k >> 2)) for k in range(8)]
    quads = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    first = 9 + 8 * number
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + ["usemtl wall"]
    return "\n".join([f"o {name}", *lines, *("f " + " ".join(str(first + k) for k in quad) for quad in quads), ""])


FURNISHED = ROOM_OBJ + crate("crate", (0.5, 2, 0.2), 0.6, 0) + crate("cup", (3, 3, 1), 0.1, 1)
FURNISHED += crate("latch", (1, 0.02, 1), 0.8, 2)


def area(mesh: Mesh, material: int) -> float:
    triangles, source = mesh.triangles()
    a, b, c = (mesh.vertices[triangles[:, corner]] for corner in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return float(areas[mesh.face_material[source] == material].sum())


def test_cut_panes_keep_their_area_and_look_the_same_way(room: Scene) -> None:
    cut = with_panes(room, 3)
    glass = next(index for index, material in enumerate(room.materials) if material.opening >= 0)
    assert opening_face_count(cut) == 9 * opening_face_count(room)
    assert area(cut.mesh, glass) == pytest.approx(area(room.mesh, glass), rel=1e-12)
    a, b, c = (cut.mesh.vertices[cut.mesh.faces[-1, corner]] for corner in range(3))
    assert np.cross(b - a, c - b)[1] < 0  # outdoors is south


def test_closing_panes_leaves_one(room: Scene) -> None:
    assert opening_face_count(with_panes(with_panes(room, 2), 0)) == 1


def test_other_glass_changes_the_transmittance_alone(room: Scene) -> None:
    other = with_other_glass(room, 0.5)
    assert other.openings[0].visible_transmittance == pytest.approx(0.39)
    assert replace(other, openings=room.openings) == room


def test_the_object_that_edits_change_is_closed_and_free_of_panes(room: Scene, tmp_path: Path) -> None:
    assert movable_object(room) is None
    assert scene_edits(room).keys() == {"recolour", "reglaze"}
    furnished = load_scene(write_scene(tmp_path / "furnished", obj=FURNISHED))
    assert movable_object(furnished) == "crate"
    edits = scene_edits(furnished)
    for moved in edits["move_object"].after:
        assert np.ptp(moved.mesh.vertices[moved.mesh.faces], axis=(0, 1)) == pytest.approx([4, 5, 3])
        assert moved.mesh.vertices[moved.mesh.faces[furnished.mesh.face_object == 2]][..., 0].max() > 1.25
    assert len(edits["add_object"].before.mesh.faces) == len(furnished.mesh.faces) - 6
    assert edits["add_object"].after == (furnished,)
    assert edits["remove_object"].after == (edits["add_object"].before,)
    (open_crate := FURNISHED.splitlines()).remove("f 9 11 12 10")
    lidless = load_scene(write_scene(tmp_path / "lidless", obj="\n".join(open_crate)))
    assert movable_object(lidless) == "cup"


def test_sweeps_are_over_patches_and_openings(room: Scene) -> None:
    points = bench_points(with_panes(room, 2), quick=False)
    assert [point.wanted_patches for point in points if point.sweep == "patches"] == [1000, 3000, 10000, 30000]
    assert [point.pane_split for point in points if point.sweep == "openings"] == [0, 2, 4]
    assert len({point.label() for point in points}) == len(points)
    assert len(bench_points(with_panes(room, 2), quick=True)) < len(points)


def test_a_sweep_has_the_patches_that_it_wants(tmp_path: Path) -> None:
    pytest.importorskip("transom._engine", reason="the engine is not built", exc_type=ImportError)
    from transom.engine import Engine, SolveOptions

    furnished = load_scene(write_scene(tmp_path / "room", obj=FURNISHED))
    solved = Engine.solve(furnished, SolveOptions(target_patch_count=target_for_patches(furnished, 400)))
    assert solved.facts()["patches"] == pytest.approx(400, rel=0.15)  # its own rays find a few more than trials do
    asked = Engine.solve(furnished, SolveOptions(target_patch_count=400))
    assert asked.facts()["patches"] != pytest.approx(400, rel=0.15)


def test_interreflection_is_set_against_memory_and_gathering_against_rays() -> None:
    class Solved:
        sweeps = 10

        class options:  # noqa: N801
            patch_rays, patch_opening_rays, node_rays, node_opening_rays = 400, 100, 800, 200

        def facts(self) -> dict[str, int]:
            return {"patches": 1000, "nodes": 2000}

        def form_factors(self) -> tuple[list[int], list[int]]:
            return [], [0] * 50_000

    limits = (Limit("memory_copy", "B/s", (8e9,), 8e9), Limit("embree_rays", "rays/s", (1e7,), 1e7))
    phases = {"relight_hour/interreflection": 1e-3, "solve/patches": 0.1}
    memory, rays = utilisations(Solved(), phases, limits)  # type: ignore[arg-type]
    assert (memory.limit, memory.share) == ("memory_copy", pytest.approx(0.5))
    assert (rays.phase, rays.rate, rays.share) == ("solve/patches", pytest.approx(5e6), pytest.approx(0.5))


def test_memory_is_copied_by_all_threads() -> None:
    limit = memory_copy()
    assert limit.median > 0
    assert len(limit.samples) == machine_limits.COPY_REPEATS


def test_a_benchmark_that_is_not_built_is_no_limit(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(machine_limits, "BENCHMARKS", tmp_path / "none")
    assert machine_limits.embree_rays() is None


def test_every_quantity_is_measured_with_its_phases(tmp_path: Path) -> None:
    pytest.importorskip("transom._engine", reason="the engine is not built", exc_type=ImportError)
    folder = write_scene(tmp_path / "room", obj=FURNISHED)
    found = measure_point(str(folder), Point("default", wanted_patches=200), 0.5)
    rows = {row.quantity: row for row in found.measurements}
    expected = {"load", "solve", "reglaze", "recolour", "relight_hour", "relight_sky", "relight_overcast", "frame_rays"}
    expected |= {"move_object", "add_object", "remove_object"}
    assert expected | {"sensors", "peak_memory"} <= rows.keys()
    assert {"move_object/nodes", "move_object/links"} <= {phase.name for phase in rows["move_object"].phases}
    assert {"solve/patches", "solve/nodes"} <= {phase.name for phase in rows["solve"].phases}
    relight = rows["relight_hour"]
    assert {"relight_hour/gather", "relight_hour/interreflection"} <= {phase.name for phase in relight.phases}
    assert (relight.beams, rows["relight_overcast"].beams, rows["sensors"].points) == (1, 0, 6)
    for row in found.measurements:
        assert row.first == row.samples[0]
        assert min(row.samples) <= row.median <= row.p95 <= max(row.samples)
        assert all(len(phase.samples) == len(row.samples) for phase in row.phases)
    assert rows["reglaze"].median > max(phase.median for phase in rows["reglaze"].phases)


@pytest.mark.slow
def test_a_whole_bench_writes_reads_and_says_what_it_left_out(tmp_path: Path) -> None:
    pytest.importorskip("transom._engine", reason="the engine is not built", exc_type=ImportError)
    folder = write_scene(tmp_path / "room")
    from rich.console import Console

    with CaseProgress(4, Console(quiet=True)) as bars:
        bench = bench_scene(str(folder), bars, budget_s=0.1, quick=True)
    write_bench(tmp_path / "bench.json", bench)
    assert read_bench(tmp_path / "bench.json") == bench
    assert any("budget" in text for text in bench.left_out)
    assert any(line.startswith("left out") for line in bench_lines(bench))
    assert bench.provenance == current_provenance()
    content = json.loads((tmp_path / "bench.json").read_text())
    assert content["measurements"][0]["samples"]


def test_a_malformed_file_is_refused_by_its_field(tmp_path: Path) -> None:
    (tmp_path / "bench.json").write_text('{"format": 2}')
    with pytest.raises(InputError, match="format"):
        read_bench(tmp_path / "bench.json")
    with pytest.raises(InputError, match="does not exist"):
        read_bench(tmp_path / "none.json")


def test_published_schema_is_that_of_the_file() -> None:
    assert SCHEMA_FILE.read_text(encoding="utf-8") == bench_schema()
    assert Bench.__name__ in bench_schema()


def test_of_needs_against(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["bench", "test_room", "--of", "HEAD"]) == WRONG_USE
    assert "--against" in capsys.readouterr().err


@pytest.mark.parametrize("name", list_products())
def test_every_product_with_parameters_takes_others(name: str) -> None:
    scene = load_glazed("test_room", [f"south_upper={name}"])
    assert has_changeable_product(scene) == bool(load_product(name).record.parameters)
    if has_changeable_product(scene):
        others = [with_other_product(scene, index) for index in (0, 100)]  # one that cannot be built is refused
        assert len({content_key(entry) for entry in [scene, *others]}) == 3


def test_a_scene_with_a_product_counts_its_lobes_and_takes_others() -> None:
    scene = load_glazed("test_room", ["south_upper=prismatic_panel"])
    sun, overcast = (resolve_condition(spec, scene.site) for spec in (scene.conditions[0], scene.conditions[-1]))
    assert beam_count(load_glazed("test_room"), sun) == 1
    assert beam_count(scene, sun) == 1 + sum(len(light.beams) for light in panel_light(scene, sun)) > 1
    assert beam_count(scene, overcast) == 0
    others = [with_other_product(scene, index) for index in range(3)]
    assert len({content_key(entry) for entry in [scene, *others]}) == 4
    assert has_changeable_product(scene) and not has_changeable_product(load_glazed("test_room"))
