"""What may happen to a store: full and read-only disks, damage, other versions. An earlier answer survives it all."""

from __future__ import annotations

import errno
import json
import os
import stat
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from harness_fakes import CheapEngine, small_condition, small_scene

from transom import files, staging
from transom.bundle import Bundle, Case, OtherVersionError, Store, cache_store, make_case, read_bundle
from transom.errors import InputError, StorageError
from transom.failures import read_failure
from transom.files import require_writable, write_atomic
from transom.renderer import ImageResult
from transom.run import Question, render_case


def picture(level: float) -> ImageResult:
    return ImageResult(np.full((8, 12, 3), level, np.float32))


def cheap_case() -> Case:
    scene = small_scene()
    return make_case(scene, small_condition(), CheapEngine(), {}, view=scene.views[0])


def write(store: Store, level: float) -> Bundle:
    return store.write(cheap_case(), image=picture(level), facts={"level": level}, wall_seconds=0.0)


def stored_level(store: Store) -> float:
    bundle = store.find(cheap_case())
    assert bundle is not None
    level = float(bundle.image().mean[0, 0, 0])
    assert bundle.record.facts["level"] == level
    return level


class Stop(BaseException):
    """Stands for kill -9: nothing after it is done."""


def test_stopped_at_any_step_of_replacing_the_old_or_the_new_answer_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stops before the n-th change of the file system, for every n, without any clean-up."""
    seen = set()
    real = {"replace": Path.replace, "rename": Path.rename}
    for stop_at in range(1, 40):
        store = Store(tmp_path / str(stop_at))
        write(store, 1.0)
        steps = 0

        def counted(name: str):  # type: ignore[no-untyped-def]
            def step(path: Path, target: Path) -> Path:
                nonlocal steps
                steps += 1
                if steps == stop_at:  # noqa: B023
                    raise Stop
                return real[name](path, target)

            return step

        with monkeypatch.context() as patch:
            for name in real:
                patch.setattr(Path, name, counted(name))
            patch.setattr(staging.shutil, "rmtree", lambda *_, **__: None)
            try:
                write(store, 2.0)
            except Stop:
                pass
            else:
                assert seen == {1.0, 2.0}
                return
        seen.add(stored_level(store))
        write(store, 3.0)
        assert stored_level(store) == 3.0
    pytest.fail("replacing an answer never came to an end")


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EROFS])
def test_disk_that_takes_no_file_is_named_and_the_old_answer_kept(
    monkeypatch: pytest.MonkeyPatch, code: int, tmp_path: Path
) -> None:
    store = Store(tmp_path / "store")
    write(store, 1.0)

    def refuse(_: int) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(files.os, "fsync", refuse)
    with pytest.raises(StorageError, match=r"image\.exr: cannot be written.*(full|read-only)"):
        write(store, 2.0)
    monkeypatch.undo()
    assert stored_level(store) == 1.0
    assert [path.name for path in store.folder(cheap_case()).iterdir() if path.name.startswith(".")] == []


def test_really_full_disk_keeps_the_old_answer(tmp_path: Path) -> None:
    """On a file system of 64 KiB, where the test may make one."""
    place = tmp_path / "tiny"
    place.mkdir()
    if os.system(f"mount -t tmpfs -o size=64k tmpfs {place} 2>{os.devnull}") != 0:
        pytest.skip("needs the right to mount a small file system")
    try:
        store = Store(place)
        write(store, 1.0)
        noise = np.random.default_rng(1).uniform(0, 1, (200, 200, 3)).astype(np.float32)
        with pytest.raises(StorageError, match="full"):
            store.write(cheap_case(), image=ImageResult(noise), facts={}, wall_seconds=0.0)
        assert stored_level(store) == 1.0
    finally:
        os.system(f"umount {place}")


def test_read_only_store_is_noticed_before_anything_is_rendered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store(tmp_path / "store")
    store.root.mkdir()
    store.root.chmod(stat.S_IRUSR | stat.S_IXUSR)
    if os.access(store.root, os.W_OK):  # root may write everywhere
        monkeypatch.setattr(files.os, "access", lambda *_: False)
    engine = CheapEngine()
    monkeypatch.setattr(engine, "render", lambda *_: pytest.fail("rendered for nothing"))
    with pytest.raises(StorageError, match="read-only"):
        render_case(engine, Question(cheap_case()), store)
    with pytest.raises(StorageError, match="TRANSOM_CACHE"):
        require_writable(tmp_path / "store" / "not" / "yet")
    store.root.chmod(stat.S_IRWXU)


def test_write_that_fails_leaves_the_old_file_and_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "verdicts.json"
    write_atomic(path, "old")

    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(files.os, "fsync", full)
    with pytest.raises(StorageError, match=r"verdicts\.json: cannot be written: the disk is full\. Free some space"):
        write_atomic(path, "new")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_bundle_of_another_version_is_refused_by_name_and_rendered_again() -> None:
    question = Question(cheap_case())
    record = render_case(CheapEngine(), question).folder / "run.json"
    content = json.loads(record.read_text())
    record.write_text(json.dumps({**content, "format": 99, "unheard_of": True}))
    with pytest.raises(OtherVersionError, match=r"run\.json: format = 99 is of another version: this Transom reads 1"):
        read_bundle(record.parent)
    assert cache_store().find(question.case) is None
    render_case(CheapEngine(), question)
    assert cache_store().find(question.case) is not None


@pytest.mark.parametrize("damage", ["truncated picture", "malformed record", "picture lost"])
def test_damaged_answer_is_rendered_again(damage: str) -> None:
    question = Question(cheap_case())
    folder = render_case(CheapEngine(), question).folder
    if damage == "truncated picture":
        (folder / "image.exr").write_bytes((folder / "image.exr").read_bytes()[:100])
    elif damage == "malformed record":
        (folder / "run.json").write_text('{"format": 1')
    else:
        (folder / "image.exr").unlink()
    assert render_case(CheapEngine(), question).image().mean[0, 0, 0] == 100.0


def test_failure_is_kept_with_what_shows_it_again_until_the_case_has_an_answer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    question = Question(cheap_case(), command="transom run rooms --scene small")
    monkeypatch.setenv("CHEAP_ENGINE_FAILS", "noon")
    with pytest.raises(ArithmeticError):
        render_case(CheapEngine(), question)
    failure = read_failure(question.case)
    assert failure is not None
    assert failure.error == "ArithmeticError: light went backwards"
    assert failure.command == "transom run rooms --scene small"
    assert "Traceback" in failure.traceback
    monkeypatch.delenv("CHEAP_ENGINE_FAILS")
    render_case(CheapEngine(), question)
    assert read_failure(question.case) is None


def test_what_a_killed_process_left_is_removed_by_the_next_one() -> None:
    case = cheap_case()
    folder = cache_store().folder(case)
    (folder / ".stage-1-dead").mkdir(parents=True)
    (folder / ".image.exr.1-dead.tmp").write_bytes(b"half")
    render_case(CheapEngine(), Question(case))
    assert sorted(path.name for path in folder.iterdir()) == ["image.exr", "run.json"]


def test_better_answer_written_meanwhile_is_read_and_not_called_damaged(tmp_path: Path) -> None:
    store = Store(tmp_path)
    earlier = write(store, 1.0)
    write(store, 2.0)
    assert earlier.image().mean[0, 0, 0] == 2.0


def test_input_errors_and_storage_errors_are_one_line() -> None:
    assert issubclass(StorageError, InputError)
