"""Making a stored reference quieter: as if all its batches had been rendered at once, and nothing else is accepted."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from harness_fakes import NoisyRenderer, small_condition, small_scene

from transom import pooling, run, visible
from transom.bundle import Bundle, Case, cache_store, make_case, read_bundle, repository_store
from transom.colour import luminance
from transom.errors import InputError
from transom.images import read_exr, write_exr
from transom.renderer import ImageResult
from transom.run import Question, Target, is_done, is_good_enough, render_case
from transom.scene.model import Scene, View
from transom.sensor_file import scene_sensors
from transom.visible import FirstSurfaces

HALF_FLOAT = 2.0**-10
"""Two roundings to half floats: of what was stored first, and of the pooled answer or the one it is compared with."""


@pytest.fixture(autouse=True)
def everything_is_interior(monkeypatch: pytest.MonkeyPatch) -> None:
    def surfaces(_: Scene, view: View) -> FirstSurfaces:
        shape = (view.height, view.width)
        return FirstSurfaces(np.zeros(shape, np.int32), np.zeros((*shape, 3), np.float32), np.ones(shape, bool))

    monkeypatch.setattr(run, "first_surfaces", surfaces)
    monkeypatch.setattr(visible, "first_surfaces", surfaces)


def image_case(renderer: NoisyRenderer, **options: object) -> Case:
    scene = small_scene()
    return make_case(scene, small_condition(), renderer, options, view=scene.views[0])


def sensor_case(renderer: NoisyRenderer) -> Case:
    scene = small_scene()
    return make_case(scene, small_condition(), renderer, {}, sensors=scene_sensors(scene))


def in_two_parts(case: Case, first: float, second: float) -> tuple[Bundle, Bundle]:
    """The stored answer with a noise of `first` percent, then made quieter without a batch left in the cache."""
    stored = render_case(NoisyRenderer(), Question(case, Target(first)), repository_store())
    assert not cache_store().batches(case).folder.exists()
    renderer = NoisyRenderer()
    extended = render_case(renderer, Question(case, Target(second)), repository_store())
    count = extended.record.effort["batches"]
    assert renderer.rendered == list(range(stored.record.effort["batches"], count)), "only what was missing"
    assert extended.folder == stored.folder
    assert not cache_store().batches(case).folder.exists()
    return stored, extended


def at_once(case: Case, count: int) -> Bundle:
    renderer = NoisyRenderer()
    question = Question(make_case(case.scene, case.condition, renderer, {"batches": count}, case.view, case.sensors))
    return render_case(renderer, question, cache_store(), fresh=True)


@pytest.mark.parametrize(("first", "second"), [(9.0, 3.0), (3.0, 2.0)])
def test_extended_picture_is_the_one_rendered_in_one_go(first: float, second: float) -> None:
    """From 8 batches to fewer than the groups of means, and from fewer to more of them."""
    case = image_case(NoisyRenderer())
    stored, extended = in_two_parts(case, first, second)
    count = extended.record.facts["batches"]
    assert extended.record.facts["batches_stored"] == stored.record.facts["batches"] < count
    assert (stored.record.facts["batches"] < pooling.MEAN_GROUPS < count) is (second == 2.0)
    whole = at_once(case, count)
    got, wanted = extended.image(), whole.image()
    assert got.halves is not None and wanted.halves is not None
    np.testing.assert_allclose(got.mean, wanted.mean, rtol=HALF_FLOAT)
    np.testing.assert_allclose(got.halves, wanted.halves, rtol=HALF_FLOAT)
    np.testing.assert_allclose(got.standard_error, wanted.standard_error, rtol=3 * HALF_FLOAT)
    percent, expected = (bundle.record.facts["relative_standard_error_percent"] for bundle in (extended, whole))
    assert percent == pytest.approx(expected, rel=1e-4)
    assert percent <= second
    groups, expected = (bundle.record.facts["group_means_cd_m2"] for bundle in (extended, whole))
    assert groups.keys() == expected.keys()
    for region in groups:
        np.testing.assert_allclose(groups[region], expected[region], rtol=1e-6)


def test_many_small_additions_stay_in_agreement_with_themselves() -> None:
    """Rounding to half floats each time adds up in the halves and in the mean alike."""
    case = image_case(NoisyRenderer())
    for most in range(32, 72, 2):
        bundle = render_case(NoisyRenderer(), Question(case, Target(0.1, max_batches=most)), repository_store())
        assert bundle.record.facts["batches"] == most
        assert pooling.finished_batches(bundle, case).count == most
    np.testing.assert_allclose(bundle.image().mean, at_once(case, most).image().mean, rtol=5 * HALF_FLOAT)


def test_region_that_has_changed_since_has_no_group_means(monkeypatch: pytest.MonkeyPatch) -> None:
    """Regions are no part of a case's key: what was stored of one may be of other pixels."""
    case = image_case(NoisyRenderer())
    left, right = np.zeros((2, 8, 12), bool)
    left[:, :6], right[:, 6:] = True, True
    masks = {"kept": left, "moved": left, "gone": right}
    monkeypatch.setattr(pooling, "region_masks", lambda *_: masks)
    render_case(NoisyRenderer(), Question(case, Target(9.0)), repository_store())
    masks = {"kept": left, "moved": right, "new": right}
    extended = render_case(NoisyRenderer(), Question(case, Target(3.0)), repository_store())
    assert extended.record.facts["group_means_cd_m2"].keys() == {"kept"}
    mean = np.average(
        extended.record.facts["group_means_cd_m2"]["kept"],
        weights=np.bincount(np.arange(extended.record.facts["batches"]) % pooling.MEAN_GROUPS),
    )
    assert mean == pytest.approx(luminance(extended.image().mean)[left].mean(), rel=1e-4)


def test_extended_sensors_are_those_measured_in_one_go() -> None:
    case = sensor_case(NoisyRenderer())
    _, extended = in_two_parts(case, 9.0, 2.0)
    whole = at_once(case, extended.record.facts["batches"])
    got, wanted = extended.sensors(), whole.sensors()
    assert got.sets == wanted.sets
    np.testing.assert_allclose(got.illuminance, wanted.illuminance, rtol=1e-6)
    np.testing.assert_allclose(got.standard_error, wanted.standard_error, rtol=1e-3)


def test_odd_number_of_stored_batches_goes_on_with_the_other_half() -> None:
    case = image_case(NoisyRenderer(), batches=7)
    render_case(NoisyRenderer(), Question(case), repository_store())
    extended = render_case(NoisyRenderer(), Question(case, Target(3.0)), repository_store())
    whole = at_once(case, extended.record.facts["batches"])
    got, wanted = extended.image(), whole.image()
    assert got.halves is not None and wanted.halves is not None
    np.testing.assert_allclose(got.halves, wanted.halves, rtol=HALF_FLOAT)


def test_stopped_while_it_is_extended_nothing_is_lost() -> None:
    case = image_case(NoisyRenderer())
    stored = render_case(NoisyRenderer(), Question(case, Target(9.0)), repository_store())
    count = stored.record.facts["batches"]
    question = Question(case, Target(3.0))
    with pytest.raises(KeyboardInterrupt):
        render_case(NoisyRenderer(stop_after=11), question, repository_store())
    kept = repository_store().find(case)
    assert kept is not None
    assert kept.record == stored.record
    assert kept.is_whole()
    resumed = NoisyRenderer()
    extended = render_case(resumed, question, repository_store())
    assert resumed.rendered == list(range(count + 11, extended.record.facts["batches"]))
    assert extended.record.facts["batches_resumed"] == 11
    assert extended.record.wall_seconds >= stored.record.wall_seconds


def test_batches_left_from_before_the_stored_answer_are_not_counted_twice() -> None:
    """A process may be killed between writing an answer and deleting its batches."""
    case = image_case(NoisyRenderer())
    stored = render_case(NoisyRenderer(), Question(case, Target(9.0)), repository_store())
    for index in range(stored.record.facts["batches"]):
        cache_store().batches(case).save(index, {"values": np.full((8, 12, 3), 1e6)})
    extended = render_case(NoisyRenderer(), Question(case, Target(3.0)), repository_store())
    np.testing.assert_allclose(
        extended.image().mean, at_once(case, extended.record.facts["batches"]).image().mean, rtol=1e-3
    )
    assert "batches_resumed" not in extended.record.facts


def test_answer_with_all_batches_that_it_may_have_is_not_rendered_again() -> None:
    case, target = image_case(NoisyRenderer()), Target(0.1, max_batches=40)
    bundle = render_case(NoisyRenderer(), Question(case, target), repository_store())
    assert bundle.record.facts["batches"] == 40
    assert bundle.record.facts["relative_standard_error_percent"] > target.percent
    assert is_done(bundle, Question(case, target))
    assert not is_good_enough(bundle, Question(case, target))
    again = NoisyRenderer()
    render_case(again, Question(case, target), repository_store())
    assert again.rendered == []


def change_record(bundle: Bundle, change: Callable[[dict[str, Any]], object]) -> None:
    path = bundle.folder / "run.json"
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


def replace_picture(bundle: Bundle, image: ImageResult) -> None:
    """Another picture with a record that fits its file."""
    path = bundle.folder / "image.exr"
    write_exr(path, image)
    content = path.read_bytes()
    entry = {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}
    change_record(bundle, lambda record: record["files"].update({"image.exr": entry}))


def other_number_of_batches(bundle: Bundle) -> None:
    change_record(bundle, lambda record: (record["facts"].update(batches=6), record["effort"].update(batches=6)))


def two_numbers_of_batches(bundle: Bundle) -> None:
    change_record(bundle, lambda record: record["effort"].update(batches=16))


def no_halves(bundle: Bundle) -> None:
    image = read_exr(bundle.folder / "image.exr")
    replace_picture(bundle, ImageResult(image.mean, None, image.standard_error))


def another_mean(bundle: Bundle) -> None:
    image = read_exr(bundle.folder / "image.exr")
    replace_picture(bundle, ImageResult(image.mean * np.float32(1.01), image.halves, image.standard_error))


def another_size(bundle: Bundle) -> None:
    image = read_exr(bundle.folder / "image.exr")
    assert image.halves is not None and image.standard_error is not None
    halves = (image.halves[0][:4], image.halves[1][:4])
    replace_picture(bundle, ImageResult(image.mean[:4], halves, image.standard_error[:4]))


@pytest.mark.parametrize(
    ("spoil", "problem"),
    [
        (other_number_of_batches, "lacks means of groups of batches, or has too many"),
        (two_numbers_of_batches, "has two numbers of batches"),
        (no_halves, "has no halves or standard error"),
        (another_mean, "has halves whose average is not its mean"),
        (another_size, "is of another size"),
    ],
)
def test_answer_that_contradicts_itself_is_refused_and_left_as_it_is(
    spoil: Callable[[Bundle], None], problem: str
) -> None:
    case = image_case(NoisyRenderer())
    stored = render_case(NoisyRenderer(), Question(case, Target(9.0)), repository_store())
    spoil(stored)
    record = (stored.folder / "run.json").read_bytes()
    renderer = NoisyRenderer()
    with pytest.raises(InputError, match=rf"run\.json: cannot be made quieter: it {problem}.*Delete"):
        render_case(renderer, Question(case, Target(3.0)), repository_store())
    assert renderer.rendered == []
    assert (stored.folder / "run.json").read_bytes() == record


def test_damaged_answer_is_no_beginning() -> None:
    """Its file is not the one that was written: nothing of it gets into the new answer."""
    case = image_case(NoisyRenderer())
    stored = render_case(NoisyRenderer(), Question(case, Target(9.0)), repository_store())
    path = stored.folder / "image.exr"
    path.write_bytes(path.read_bytes()[:-9])
    renderer = NoisyRenderer()
    bundle = render_case(renderer, Question(case, Target(3.0)), repository_store())
    assert renderer.rendered == list(range(bundle.record.facts["batches"]))
    assert "batches_stored" not in bundle.record.facts
    assert read_bundle(bundle.folder) is not None
