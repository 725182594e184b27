"""Suites: named lists of cases, from scenes/suites.toml (its form is in scenes/README.md)."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from transom.daylight.condition import Condition, resolve_condition
from transom.errors import InputError, invalid_field
from transom.fenestration.reglazing import reglazed
from transom.scene import load_scene, scene_root
from transom.scene.model import ConditionSpec, Scene, View

Named = TypeVar("Named", View, ConditionSpec)


class CaseEntry(BaseModel):
    """Views and conditions of one scene: names, "*" for all, or omitted for the scene's first.

    glazing: OPENING=GLAZING, as on the command line: the case is of that variant of the scene.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    scene: str
    views: list[str] | None = None
    conditions: list[str] | None = None
    glazing: list[str] = []
    sensors: bool = True


class SuiteEntry(BaseModel):
    """One suite. target_percent: mean relative standard error at which a published reference is good enough.

    width: pictures are this wide and keep their view's proportions; omitted: the view's own size.
    reference: who knows the truth. layout: how a report shows it, view by view or as a grid of hours.
    report: whether the report runs it. known: cases with a known answer that are drawn in code (transom.known.suite),
    or groups of hard cases (transom.hard_cases).
    programs: renderers that a suite of known answers judges. method: how the engine finds light.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    title: str
    description: str = ""
    target_percent: float = Field(default=1.0, gt=0.0)
    width: int | None = Field(default=None, gt=0)
    reference: Literal["mitsuba", "closed_form", "crosscheck", "hard"] = "mitsuba"
    layout: Literal["views", "hours"] = "views"
    report: bool = True
    known: list[str] = []
    programs: list[str] = ["engine"]
    method: Literal["gather", "classic"] = "gather"
    cases: list[CaseEntry] = []

    @model_validator(mode="after")
    def _holds_something(self) -> SuiteEntry:
        if not self.cases and not self.known:
            raise ValueError("a suite needs cases, or known ones")
        return self


class SuiteFile(BaseModel):
    """scenes/suites.toml."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    format: Literal[1]
    suites: dict[str, SuiteEntry]


@dataclass(frozen=True)
class SuiteCase:
    """One scene in one condition: the views to render, at their final size, whether to measure the sensors, and the
    engine's method."""

    scene: Scene
    condition: Condition
    views: tuple[View, ...]
    sensors: bool
    method: str = "gather"


@dataclass(frozen=True)
class Suite:
    """A suite with its scenes loaded and its conditions resolved."""

    name: str
    title: str
    description: str
    target_percent: float
    reference: str
    layout: str
    cases: tuple[SuiteCase, ...]
    known: tuple[str, ...] = ()
    programs: tuple[str, ...] = ("engine",)


def suites_file() -> Path:
    return scene_root() / "suites.toml"


def read_suites(path: Path | None = None) -> dict[str, SuiteEntry]:
    """All suites by name, without loading a scene. Raises InputError for a malformed file."""
    path = path or suites_file()
    try:
        return SuiteFile.model_validate(tomllib.loads(path.read_text(encoding="utf-8"))).suites
    except FileNotFoundError as error:
        raise InputError("does not exist", file=path) from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"is not TOML ({error})", file=path) from error
    except ValidationError as error:
        raise invalid_field(error, path) from error


def load_suite(name: str, path: Path | None = None) -> Suite:
    """A suite ready to run. Raises InputError for an unknown suite, scene, view or condition."""
    suites = read_suites(path)
    if name not in suites:
        raise InputError("is not a suite", field="SUITE", value=name, remedy=f"Choose one of {', '.join(suites)}")
    entry = suites[name]
    cases = [case for line in entry.cases for case in _cases(line, entry.width, entry.method)]
    return Suite(
        name,
        entry.title,
        entry.description,
        entry.target_percent,
        entry.reference,
        entry.layout,
        tuple(cases),
        tuple(entry.known),
        tuple(entry.programs),
    )


def choose(entries: Sequence[Named], names: Sequence[str] | None, scene: Scene, kind: str) -> tuple[Named, ...]:
    """Entries by name: None the first, "*" all. Raises InputError for a name that the scene does not have."""
    if names is None:
        return tuple(entries[:1])
    if list(names) == ["*"]:
        return tuple(entries)
    by_name = {entry.name: entry for entry in entries}
    for name in names:
        if name not in by_name:
            raise InputError(
                f"is not a {kind} of {scene.name}",
                file=scene.file,
                field=kind,
                value=name,
                remedy=f"Choose from {', '.join(by_name) or 'none: the scene has no ' + kind}",
            )
    return tuple(by_name[name] for name in names)


def is_of_scenes(scene: Scene, names: Collection[str]) -> bool:
    """Whether the scene, or the one that it is a variant of, is among names or shell patterns. No names: yes."""
    return not names or any(fnmatchcase(own, name) for own in (scene.name, scene.variant_of) for name in names)


def resized(view: View, width: int, height: int | None = None) -> View:
    """The view at another size; without `height` it keeps its proportions."""
    return dataclasses.replace(view, width=width, height=height or max(1, round(width * view.height / view.width)))


def _cases(line: CaseEntry, width: int | None, method: str) -> list[SuiteCase]:
    scene = reglazed(load_scene(line.scene), line.glazing)
    views = choose(scene.views, line.views, scene, "view")
    if width is not None:
        views = tuple(resized(view, width) for view in views)
    specs = choose(scene.conditions, line.conditions, scene, "condition")
    measured = line.sensors and bool(scene.sensors)
    return [SuiteCase(scene, resolve_condition(spec, scene.site), views, measured, method) for spec in specs]
