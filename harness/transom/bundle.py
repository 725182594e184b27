"""Run bundles: what one renderer produced for one case, in a folder whose name is a hash of everything it depends on.

    <store>/<label>-<first 12 digits of the key>/
        run.json      the record below; put there last, so that a folder without it is unfinished
        image.exr     the picture and its layers (transom.images), for a case with a view
        sensors.csv   set,x,y,z,nx,ny,nz,illuminance_lx,standard_error_lx, for a case with sensors
        trace.json    phases of the engine for Perfetto, where there is one
        batches/      independently seeded parts of an unfinished reference, so that a killed run repeats nothing
        failed.json   why the case failed, if it did (transom.failures)

A new answer replaces an old one as a whole (transom.staging): until it is complete, the old one stays readable.

Published references are in the repository (reference/store/); everything else is in the user's cache folder.
"""

from __future__ import annotations

import hashlib
import importlib.util
import io
import json
import os
import shutil
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from transom.daylight.condition import Condition
from transom.errors import InputError
from transom.fenestration.light import light_digest
from transom.files import json_text, write_atomic
from transom.images import read_exr, write_exr
from transom.provenance import Provenance, current_provenance
from transom.renderer import ImageResult, Renderer
from transom.scene import content_key
from transom.scene.model import Scene, View
from transom.sensor_file import SensorTable, read_sensors, write_sensors
from transom.staging import RECORD, settle, staged

BUNDLE_FORMAT = 1
"""Raised when bundles of an earlier form can no longer be read; part of every key."""

EFFORT_OPTIONS = frozenset({"batches"})
"""Options that say how long to look and not what to find: more batches are a better answer to the same question."""

DATA_FILES = ("image.exr", "sensors.csv", "trace.json")

REPOSITORY_STORE = Path(__file__).resolve().parents[2] / "reference" / "store"


class OtherVersionError(InputError):
    """A bundle of another BUNDLE_FORMAT: not an answer here, and no damage."""


class FileRecord(BaseModel):
    """One file of a bundle, so that a damaged copy is noticed."""

    model_config = ConfigDict(frozen=True)

    bytes: int
    sha256: str


class RunRecord(BaseModel):
    """run.json. inputs: what was hashed into `key`. facts: what the renderer says of its own work."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: int
    key: str
    label: str
    kind: str
    inputs: dict[str, Any]
    effort: dict[str, Any]
    facts: dict[str, Any]
    files: dict[str, FileRecord]
    wall_seconds: float
    finished: datetime
    provenance: Provenance


@dataclass(frozen=True)
class Case:
    """One question to one renderer: a picture (view) or illuminances (sensors), and the key of its answer."""

    scene: Scene
    condition: Condition
    renderer: str
    renderer_version: str
    options: Mapping[str, Any]
    view: View | None = None
    sensors: SensorTable | None = None

    def __post_init__(self) -> None:
        if (self.view is None) == (self.sensors is None):
            raise ValueError("a case has either a view or sensors")

    @property
    def kind(self) -> str:
        return "image" if self.view is not None else "sensors"

    @property
    def label(self) -> str:
        """For people: scene, view (or "sensors"), condition, renderer."""
        place = self.view.name if self.view is not None else "sensors"
        return _slug("-".join([self.scene.name, place, self.condition.name, self.renderer]))

    def inputs(self) -> dict[str, Any]:
        """Everything that the answer depends on, as JSON values. Names that people chose are not part of it."""
        identity: dict[str, Any] = {
            "format": BUNDLE_FORMAT,
            "scene": content_key(self.scene),
            "condition": self.condition.key(),
            "renderer": self.renderer,
            "renderer_version": self.renderer_version,
            "options": {name: self.options[name] for name in sorted(self.options) if name not in EFFORT_OPTIONS},
        }
        behind_products = light_digest(self.scene, self.condition)
        if behind_products is not None:
            identity["fenestration"] = behind_products
        if self.view is not None:
            view = self.view
            identity["view"] = {
                "position_m": list(view.position),
                "target_m": list(view.target),
                "up": list(view.up),
                "vertical_fov_rad": view.vertical_fov_rad,
                "size": [view.width, view.height],
            }
        if self.sensors is not None:
            identity["sensors"] = _array_key(self.sensors.points, self.sensors.normals)
        return identity

    @property
    def key(self) -> str:
        """sha256 of `inputs`, hexadecimal."""
        return hashlib.sha256(json.dumps(self.inputs(), sort_keys=True).encode()).hexdigest()


def make_case(
    scene: Scene,
    condition: Condition,
    renderer: Renderer,
    options: Mapping[str, Any],
    view: View | None = None,
    sensors: SensorTable | None = None,
) -> Case:
    """A case for `renderer` with `options` over its defaults. Raises InputError for an option that it does not have."""
    known = renderer.default_options()
    for name, value in options.items():
        if name not in known:
            raise InputError(
                f"is not an option of the {renderer.name} renderer",
                field=name,
                value=value,
                remedy=f"Choose from {', '.join(known)}",
            )
    version = renderer.version
    if renderer.name == "engine":
        version += f"+{_engine_build()}"
    return Case(scene, condition, renderer.name, version, {**known, **options}, view, sensors)


@dataclass(frozen=True)
class Bundle:
    """A finished run on disk."""

    folder: Path
    record: RunRecord

    def image(self) -> ImageResult:
        """The picture, with the record's facts. Raises InputError if the file is not what was written."""
        result = read_exr(self._checked("image.exr"))
        return ImageResult(result.mean, result.halves, result.standard_error, result.components, self.record.facts)

    def sensors(self) -> SensorTable:
        """The illuminances. Raises InputError if the file is not what was written."""
        return read_sensors(self._checked("sensors.csv"))

    def is_whole(self) -> bool:
        """Whether every file is the one that was written."""
        return all(_is_file(self.folder / name, expected) for name, expected in self.record.files.items())

    def _checked(self, name: str) -> Path:
        path = self.folder / name
        expected = self.record.files.get(name)
        if expected is None:
            raise InputError(f"is a bundle without {name}", file=self.folder)
        if _is_file(path, expected):
            return path
        # Another process may have put a better answer here since the record was read.
        present = read_bundle(self.folder)
        if present is not None and name in present.record.files and _is_file(path, present.record.files[name]):
            return path
        raise InputError(
            "is damaged: it is not the file that was written",
            file=path,
            remedy=f"Delete {self.folder} and run again",
        )


@dataclass(frozen=True)
class BatchStore:
    """Finished batches of an unfinished reference: each is an .npz file named by its number.

    first: number of the first one that is wanted; those before it are part of an answer that is already there.
    """

    folder: Path
    first: int = 0

    def has(self, index: int) -> bool:
        return self._path(index).is_file()

    def load(self, index: int) -> dict[str, NDArray[Any]]:
        """Arrays of a batch. A damaged one is deleted and raises InputError: run again, and it is rendered again."""
        path = self._path(index)
        try:
            with path.open("rb") as stream, np.load(stream, allow_pickle=False) as arrays:
                return {name: arrays[name] for name in arrays.files}
        except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
            path.unlink(missing_ok=True)
            raise InputError(f"was damaged and is deleted ({error})", file=path, remedy="Run again") from error

    def save(self, index: int, arrays: Mapping[str, NDArray[Any]]) -> None:
        stream = io.BytesIO()
        np.savez(stream, allow_pickle=False, **arrays)
        write_atomic(self._path(index), stream.getvalue())

    def count(self) -> int:
        """How many there are that are wanted."""
        return sum(1 for path in self.folder.glob("[0-9]*.npz") if int(path.stem) >= self.first)

    def _path(self, index: int) -> Path:
        return self.folder / f"{index:04d}.npz"


@dataclass(frozen=True)
class Store:
    """A folder of bundles."""

    root: Path

    def folder(self, case: Case) -> Path:
        return self.root / f"{case.label}-{case.key[:12]}"

    def find(self, case: Case) -> Bundle | None:
        """The finished bundle of a case, whatever label it was given, or None."""
        key = case.key
        for folder in sorted(self.root.glob(f"*-{key[:12]}")):
            with suppress(OtherVersionError):
                bundle = read_bundle(folder)
                if bundle is not None and bundle.record.key == key:
                    return bundle
        return None

    def batches(self, case: Case, first: int = 0) -> BatchStore:
        return BatchStore(self.folder(case) / "batches", first)

    def write(
        self,
        case: Case,
        *,
        image: ImageResult | None = None,
        sensors: SensorTable | None = None,
        facts: Mapping[str, Any],
        trace: Mapping[str, Any] | None = None,
        wall_seconds: float,
        half: bool = True,
    ) -> Bundle:
        """Writes a finished run, which replaces an earlier answer of the same case as a whole, or not at all.

        Raises StorageError when the disk is full or read-only; the earlier answer is then as it was.
        """
        folder = self.folder(case)
        with staged(folder) as stage:
            if image is not None:
                write_exr(stage / "image.exr", image, half)
            if sensors is not None:
                write_sensors(stage / "sensors.csv", sensors)
            if trace is not None:
                write_atomic(stage / "trace.json", json.dumps(trace))
            record = RunRecord(
                format=BUNDLE_FORMAT,
                key=case.key,
                label=case.label,
                kind=case.kind,
                inputs=case.inputs(),
                effort={name: case.options[name] for name in sorted(EFFORT_OPTIONS & case.options.keys())},
                facts=dict(facts),
                files={name: _file_record(stage / name) for name in DATA_FILES if (stage / name).is_file()},
                wall_seconds=round(wall_seconds, 3),
                finished=datetime.now(UTC).replace(microsecond=0),
                provenance=current_provenance(),
            )
            write_atomic(stage / RECORD, json_text(record.model_dump(mode="json")))
        return Bundle(folder, record)

    def drop_batches(self, case: Case) -> None:
        """Deletes the batches of a finished case."""
        shutil.rmtree(self.folder(case) / "batches", ignore_errors=True)


def read_bundle(folder: Path) -> Bundle | None:
    """The bundle in a folder, or None while it is unfinished.

    Raises OtherVersionError for a bundle of another format, and InputError for a malformed run.json.
    """
    with suppress(OSError):  # a folder that cannot be written keeps its earlier answer
        settle(folder)
    path = folder / RECORD
    try:
        text = path.read_bytes()
    except FileNotFoundError:
        return None
    remedy = f"Delete {folder} and run again"
    try:
        content = json.loads(text)
        version = content["format"]
    except (ValueError, TypeError, KeyError) as error:
        raise InputError(f"is not a run record ({error})", file=path, remedy=remedy) from error
    if version != BUNDLE_FORMAT:
        problem = f"is of another version: this Transom reads {BUNDLE_FORMAT}"
        raise OtherVersionError(problem, file=path, field="format", value=version, remedy=remedy)
    try:
        return Bundle(folder, RunRecord.model_validate(content))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or RECORD
        raise InputError(f"is not valid ({first['msg']})", file=path, field=place, remedy=remedy) from error


def cache_store() -> Store:
    """The user's own bundles: $TRANSOM_CACHE, else ~/.cache/transom."""
    configured = os.environ.get("TRANSOM_CACHE")
    return Store(Path(configured) if configured else Path.home() / ".cache" / "transom")


def repository_store() -> Store:
    """The published references, part of the repository ($TRANSOM_REFERENCES: another folder)."""
    configured = os.environ.get("TRANSOM_REFERENCES")
    return Store(Path(configured) if configured else REPOSITORY_STORE)


def stores() -> Iterator[Store]:
    """Where an answer is looked up, in order."""
    yield repository_store()
    yield cache_store()


def find_bundle(case: Case) -> Bundle | None:
    """The answer to a case from the repository or else the cache, or None."""
    for store in stores():
        bundle = store.find(case)
        if bundle is not None:
            return bundle
    return None


@cache
def _engine_build() -> str:
    """Hash of the engine as it is built here: a rebuilt engine renders again. References declare a version instead,
    because each costs minutes and does not change with every edit."""
    digest = hashlib.sha256()
    for module in ("transom._engine", "transom.engine", "transom.engine_renderer"):
        found = importlib.util.find_spec(module)
        if found is None or found.origin is None:
            raise InputError("is not built", field=module, remedy="Build the engine: make setup")
        digest.update(Path(found.origin).read_bytes())
    return digest.hexdigest()[:12]


def _array_key(*arrays: NDArray[np.float64]) -> str:
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(str(array.shape).encode() + np.ascontiguousarray(array, "<f8").tobytes())
    return digest.hexdigest()


def _is_file(path: Path, expected: FileRecord) -> bool:
    return path.is_file() and path.stat().st_size == expected.bytes and _file_record(path) == expected


def _file_record(path: Path) -> FileRecord:
    content = path.read_bytes()
    return FileRecord(bytes=len(content), sha256=hashlib.sha256(content).hexdigest())


def _slug(text: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "_-" else "_" for letter in text)
