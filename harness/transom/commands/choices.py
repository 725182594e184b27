"""From command-line words to scene, view, condition, options and output: shared by the subcommands."""

from __future__ import annotations

import dataclasses
import re
from enum import StrEnum
from pathlib import Path

from transom.errors import InputError
from transom.scene.model import ConditionSpec, Scene, View
from transom.suite import choose, resized

LARGEST_SIDE = 16384
"""Pixels: a wider picture is more likely a slip of the finger than a wish."""


class RendererName(StrEnum):
    """Renderers that a user can choose."""

    engine = "engine"
    mitsuba = "mitsuba"
    radiance = "radiance"


class Method(StrEnum):
    """How the engine finds light: gathered at nodes, or by the published method that it began with."""

    gather = "gather"
    classic = "classic"


class Visibility(StrEnum):
    """How the engine finds the direct sun: stencil shadow volumes or shadow rays."""

    volumes = "volumes"
    rays = "rays"


def chosen_view(scene: Scene, name: str | None, size: str | None) -> View:
    """The view of that name (default: the scene's first), at WxH if given."""
    views = choose(scene.views, None if name is None else [name], scene, "view")
    if not views:
        raise InputError("has no view", file=scene.file, remedy="Add a [[views]] table")
    if size is None:
        return views[0]
    found = re.fullmatch(r"(\d+)x(\d+)", size)
    if not found or not all(1 <= int(side) <= LARGEST_SIDE for side in found.groups()):
        remedy = f"Write width x height in pixels, up to {LARGEST_SIDE} each, such as 640x480"
        raise InputError("is not a size", field="--size", value=size, remedy=remedy)
    return resized(views[0], int(found[1]), int(found[2]))


def chosen_condition(scene: Scene, name: str | None, time: str | None, sky: str | None) -> ConditionSpec:
    """The condition of that name (default: the scene's first), with another time or sky if given.

    A scene's absolute levels belong to its own time and sky: another time or sky takes them from the IES
    availability model (or from the Perez sky's own irradiances).
    """
    specs = choose(scene.conditions, None if name is None else [name], scene, "condition")
    if not specs and time is None:
        remedy = "Add a [[conditions]] table, or give --time and --sky"
        raise InputError("has no condition", file=scene.file, remedy=remedy)
    spec = specs[0] if specs else ConditionSpec("command", str(time))
    changed_time = time is not None and time != spec.time
    changed_sky = sky is not None and sky != spec.sky
    if not changed_time and not changed_sky:
        return spec
    return dataclasses.replace(
        spec,
        name=re.sub(r"[^A-Za-z0-9]+", "_", f"{time or spec.time}_{sky or spec.sky}").strip("_"),
        time=time or spec.time,
        sky=sky or spec.sky,
        zenith_luminance_cd_m2=None,
        diffuse_horizontal_illuminance_lx=None,
        direct_normal_illuminance_lx=None,
    )


def checked_output(path: Path, endings: tuple[str, ...]) -> Path:
    """The output path, refused before any work is done if its ending or folder is wrong."""
    if path.suffix.lower() not in endings:
        remedy = f"End it in {' or '.join(endings)}"
        raise InputError("has an unknown ending", field="-o", value=str(path), remedy=remedy)
    if path.is_dir():
        raise InputError("is a folder", field="-o", value=str(path))
    if not path.absolute().parent.is_dir():
        raise InputError("is in a folder that does not exist", field="-o", value=str(path), remedy="Make it first")
    return path


def checked_sun(sun: str, renderer: RendererName) -> None:
    """Raises InputError for what is no sun, and for any but a point where another program than the engine renders."""
    from transom.daylight.sun_disc import parse_sun

    if parse_sun(sun, "--sun") != 1 and renderer is not RendererName.engine:
        raise InputError(
            "is a form that the engine's sun alone can have", field="--sun", value=sun, remedy="Leave it out"
        )
