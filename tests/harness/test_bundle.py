"""Run bundles: whole or absent, found again by content, and references that resume."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from harness_fakes import NoisyRenderer, grey, small_condition, small_scene

from transom import run, visible
from transom.bundle import BatchStore, Store, cache_store, make_case, read_bundle, repository_store
from transom.colour import luminance
from transom.errors import InputError
from transom.images import read_exr, write_exr
from transom.renderer import ImageResult
from transom.run import Question, Target, render_case
from transom.scene.model import Scene
from transom.sensor_file import read_sensors, scene_sensors
from transom.visible import FirstSurfaces

HARNESS = str(Path(__file__).resolve().parents[2] / "harness")


@pytest.fixture(autouse=True)
def everything_is_interior(monkeypatch: pytest.MonkeyPatch) -> None:
    def surfaces(_: Scene, view: object) -> FirstSurfaces:
        shape = (view.height, view.width)  # type: ignore[attr-defined]
        return FirstSurfaces(np.zeros(shape, np.int32), np.zeros((*shape, 3), np.float32), np.ones(shape, bool))

    monkeypatch.setattr(run, "first_surfaces", surfaces)
    monkeypatch.setattr(visible, "first_surfaces", surfaces)


def image_case(renderer: NoisyRenderer, scene: Scene | None = None, **options: object):  # type: ignore[no-untyped-def]
    scene = scene or small_scene()
    return make_case(scene, small_condition(), renderer, options, view=scene.views[0])


def test_exr_returns_every_layer_that_was_written(tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    pictures = [random.uniform(0, 900, (8, 12, 3)).astype(np.float32) for _ in range(4)]
    error = random.uniform(0, 9, (8, 12)).astype(np.float32)
    result = ImageResult(pictures[0], (pictures[1], pictures[2]), error, {"sun": pictures[3]})
    write_exr(tmp_path / "full.exr", result, half=False)
    read = read_exr(tmp_path / "full.exr")
    assert read.halves is not None and read.standard_error is not None
    for got, wanted in zip((read.mean, *read.halves, read.components["sun"]), pictures, strict=True):
        np.testing.assert_array_equal(got, wanted)
    np.testing.assert_array_equal(read.standard_error, error)


def test_half_floats_round_by_less_than_their_precision_and_never_overflow(tmp_path: Path) -> None:
    picture = np.full((4, 4, 3), 123.456, np.float32)
    picture[0, 0] = 1e6
    write_exr(tmp_path / "half.exr", ImageResult(picture))
    np.testing.assert_allclose(read_exr(tmp_path / "half.exr").mean, picture, rtol=2**-11)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_truncated_exr_is_refused_by_name(tmp_path: Path, share: float) -> None:
    path = tmp_path / "cut.exr"
    write_exr(path, ImageResult(np.random.default_rng(1).uniform(0, 9, (64, 64, 3)).astype(np.float32)))
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(InputError, match=r"cut\.exr"):
        read_exr(path)


def test_key_depends_on_content_and_not_on_names() -> None:
    renderer = NoisyRenderer()
    scene = small_scene()
    key = image_case(renderer).key
    renamed = dataclasses.replace(scene, name="other", title="Other", regions=(), conditions=())
    assert image_case(renderer, renamed).key == key
    brighter_screen = dataclasses.replace(scene, views=(dataclasses.replace(scene.views[0], display_white_cd_m2=5.0),))
    assert image_case(renderer, brighter_screen).key == key
    wider = dataclasses.replace(scene, views=(dataclasses.replace(scene.views[0], width=13),))
    others = {
        image_case(renderer, small_scene(reflectance=0.6)).key,
        image_case(renderer, wider).key,
        image_case(renderer, seed=2).key,
    }
    assert len(others | {key}) == 4
    assert image_case(renderer, batches=99).key == key, "more batches are a better answer to the same question"


def test_unknown_option_is_refused() -> None:
    with pytest.raises(InputError, match=r"sed = 1 is not an option of the mitsuba renderer"):
        image_case(NoisyRenderer(), sed=1)


def test_second_run_renders_nothing() -> None:
    renderer = NoisyRenderer()
    question = Question(image_case(renderer))
    first = render_case(renderer, question)
    count = len(renderer.rendered)
    second = render_case(renderer, question)
    assert len(renderer.rendered) == count > 0
    assert second.record == first.record
    np.testing.assert_array_equal(first.image().mean, second.image().mean)


def test_repository_is_looked_at_before_the_cache() -> None:
    renderer = NoisyRenderer()
    question = Question(image_case(renderer))
    published = render_case(renderer, question, repository_store())
    assert render_case(renderer, question, cache_store()).folder == published.folder


def test_reference_stops_when_its_noise_meets_the_target_and_not_much_later() -> None:
    renderer = NoisyRenderer(relative_noise=0.2)
    question = Question(image_case(renderer), Target(percent=2.0))
    bundle = render_case(renderer, question, repository_store())
    noise = bundle.record.facts["relative_standard_error_percent"]
    assert 1.5 < noise <= 2.0
    assert bundle.record.facts["batches"] >= run.LEAST_BATCHES
    assert sorted(renderer.rendered) == list(range(bundle.record.facts["batches"])), "no batch is rendered twice"
    assert not cache_store().batches(question.case).folder.exists()


def test_few_batches_are_not_enough_to_judge_by_however_quiet_they_are() -> None:
    renderer = NoisyRenderer(relative_noise=0.001)
    case = image_case(renderer)
    preview = render_case(renderer, Question(case, Target(4.0)), repository_store())
    assert preview.record.facts["batches"] == run.PREVIEW_BATCHES
    judged = render_case(renderer, Question(case, Target(1.0)), repository_store())
    assert judged.record.facts["batches"] == run.LEAST_BATCHES
    assert sorted(renderer.rendered) == list(range(run.LEAST_BATCHES))


def test_killed_reference_goes_on_where_it_was_and_gives_the_same_answer() -> None:
    interrupted = NoisyRenderer(stop_after=11)
    question = Question(image_case(interrupted), Target(percent=4.0))
    with pytest.raises(KeyboardInterrupt):
        render_case(interrupted, question, repository_store())
    assert repository_store().find(question.case) is None
    assert not list(repository_store().root.rglob("*")), "nothing half-written where references are published"
    resumed = NoisyRenderer()
    bundle = render_case(resumed, question, repository_store())
    assert min(resumed.rendered) == 11
    assert bundle.record.facts["batches_resumed"] == 11
    at_once = render_case(NoisyRenderer(), question, repository_store(), fresh=True)
    np.testing.assert_array_equal(bundle.image().mean, at_once.image().mean)


def test_reference_killed_at_any_moment_leaves_only_whole_files() -> None:
    """Kills a process that renders references without end, and finds every batch and bundle whole."""
    script = """
import sys
sys.path.insert(0, sys.argv[1])
from harness_fakes import NoisyRenderer, small_condition, small_scene
from transom.bundle import make_case, repository_store
from transom import run, visible
run._image_percent = lambda *_: 1.0
run.group_means = lambda *_: {}
scene = small_scene()
for seed in range(1_000_000):
    case = make_case(scene, small_condition(), NoisyRenderer(), {"seed": seed, "batches": 6}, view=scene.views[0])
    run.render_case(NoisyRenderer(), run.Question(case), repository_store())
    print("one is finished", flush=True)
"""
    for delay_s in (0.05, 0.21, 0.4):
        command = [sys.executable, "-c", script, str(Path(__file__).parent)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": HARNESS}) as process:
            assert process.stdout is not None
            process.stdout.readline()
            time.sleep(delay_s)
            process.kill()
    for path in cache_store().root.rglob("*.npz"):
        if not path.name.startswith("."):
            assert BatchStore(path.parent).load(int(path.stem))["values"].shape == (8, 12, 3)
    bundles = [bundle for folder in repository_store().root.iterdir() if (bundle := read_bundle(folder))]
    assert bundles
    for bundle in bundles:
        bundle.image()


def test_folder_without_record_is_unfinished_and_damaged_picture_is_noticed() -> None:
    renderer = NoisyRenderer()
    question = Question(image_case(renderer))
    bundle = render_case(renderer, question)
    path = bundle.folder / "image.exr"
    content = path.read_bytes()
    path.write_bytes(content[:-7])
    with pytest.raises(InputError, match="damaged"):
        bundle.image()
    (bundle.folder / "run.json").unlink()
    assert read_bundle(bundle.folder) is None
    assert cache_store().find(question.case) is None


def test_malformed_record_is_an_error_that_says_what_to_do() -> None:
    renderer = NoisyRenderer()
    bundle = render_case(renderer, Question(image_case(renderer)))
    (bundle.folder / "run.json").write_text('{"format": 1')
    with pytest.raises(InputError, match="Delete"):
        read_bundle(bundle.folder)


def test_write_that_fails_leaves_no_record(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    renderer = NoisyRenderer()
    case = image_case(renderer)
    store = Store(tmp_path / "store")

    def fail(*_: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr("transom.bundle.write_exr", fail)
    with pytest.raises(OSError, match="no space"):
        store.write(case, image=ImageResult(np.zeros((8, 12, 3), np.float32)), facts={}, wall_seconds=0.0)
    assert store.find(case) is None


def test_damaged_batch_is_deleted_and_named(tmp_path: Path) -> None:
    batches = BatchStore(tmp_path)
    batches.save(3, {"values": np.arange(1000.0)})
    path = tmp_path / "0003.npz"
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(InputError, match=r"0003\.npz"):
        batches.load(3)
    assert not batches.has(3)


def test_sensors_of_a_bundle_are_those_measured() -> None:
    renderer = NoisyRenderer(relative_noise=0.01)
    scene = small_scene()
    table = scene_sensors(scene)
    case = make_case(scene, small_condition(), renderer, {}, sensors=table)
    bundle = render_case(renderer, Question(case, Target(0.2)), repository_store())
    measured = bundle.sensors()
    assert measured.sets == ("grid", "grid")
    assert measured.illuminance is not None
    np.testing.assert_allclose(measured.illuminance, 100.0, rtol=0.02)


def test_halves_average_to_the_mean() -> None:
    renderer = NoisyRenderer()
    image = render_case(renderer, Question(image_case(renderer))).image()
    assert image.halves is not None
    np.testing.assert_allclose(
        luminance(image.mean), (luminance(image.halves[0]) + luminance(image.halves[1])) / 2, rtol=2e-3
    )
    assert grey(np.zeros((2, 2))).shape == (2, 2, 3)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "is empty"),
        ("x,y,z\n1,2,3\n", "lacks the column nx"),
        ("x,y,z,nx,ny,nz\n", "holds no sensor"),
        ("x,y,z,nx,ny,nz\n1,2,three,0,0,1\n", r"sensor 1, z = 'three' is not a number"),
        ("x,y,z,nx,ny,nz\n1,2,nan,0,0,1\n", "is not finite"),
        ("x,y,z,nx,ny,nz\n1,2,3,0,0,0\n", "normal of no length"),
        ("x,y,z,nx,ny,nz\n1,2,3,0,0\n", "has 5 cells where 6 are needed"),
        ("x,y,z,nx,ny,nz,colour\n1,2,3,0,0,1,7\n", "unknown or repeated column"),
    ],
)
def test_bad_sensor_file_is_one_clear_line(tmp_path: Path, text: str, problem: str) -> None:
    path = tmp_path / "points.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=problem) as caught:
        read_sensors(path)
    assert "\n" not in str(caught.value)
