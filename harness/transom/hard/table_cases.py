"""Error tables and skies that hold what no number can be made of: empty regions, black pixels, NaN."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from transom.compare import CaseNames, ImageComparison, compare_images, compare_region
from transom.comparison import COMPARISON_FORMAT, Comparison
from transom.daylight import resolve_condition
from transom.daylight.condition import Condition
from transom.hard.claims import Case, Claim, Lit, Seen, refused
from transom.hard.rooms import windowed_room
from transom.judge import exit_code, judge, read_tolerances
from transom.renderer import ImageResult
from transom.scene import scene_root
from transom.scene.model import Scene
from transom.visible import region_masks

GROUP = "table"
NAMES = CaseNames("scene", "day", "engine", "reference")
SHAPE = (16, 16, 3)


def table_cases() -> list[Case]:
    black = np.zeros(SHAPE, np.float32)
    grey = np.full(SHAPE, 100.0, np.float32)
    spotted = grey.copy()
    spotted[3:5, 3:5] = 0.0
    nan = grey.copy()
    nan[0, 0] = math.nan
    everywhere = np.ones(SHAPE[:2], bool)
    return [
        _numbers("black pixel in the reference", grey, spotted),
        _numbers("black reference", grey, black),
        _numbers("black picture and reference", black, black),
        Case("region that the view does not see", GROUP, (_unseen_region(),)),
        Case(
            "empty region",
            GROUP,
            (
                refused(
                    "refused",
                    lambda: compare_region(ImageResult(grey), ImageResult(grey), ~everywhere, "desk", NAMES),
                    ("desk", "no pixel"),
                    ValueError,
                ),
            ),
        ),
        Case("NaN in a picture", GROUP, (_nan_fails(nan, grey, everywhere),)),
        *_skies(),
    ]


def _numbers(name: str, engine: NDArray[np.float32], reference: NDArray[np.float32]) -> Case:
    def check() -> Seen:
        masks = {"interior": np.ones(SHAPE[:2], bool)}
        (row,) = compare_images(ImageResult(engine), ImageResult(reference), masks, NAMES)
        numbers = [v for v in vars(row).values() if isinstance(v, float)]
        text = f"mean relative error {row.mean_relative_error_percent:.4g} %, bias {row.bias_percent:.4g} %"
        return Seen(all(math.isfinite(v) for v in numbers), text)

    def verdict() -> Seen:
        masks = {"interior": np.ones(SHAPE[:2], bool)}
        (row,) = compare_images(ImageResult(engine), ImageResult(reference), masks, NAMES)
        differs = not np.array_equal(engine, reference)
        passes = _passes(row)
        return Seen(passes != differs, f"judged as {'right' if passes else 'wrong'}")

    return Case(
        name,
        GROUP,
        (
            Claim("finite", "every number of the row is finite", check),
            Claim("verdict", "pictures that differ do not pass, equal ones do", verdict),
        ),
    )


def _passes(row: ImageComparison) -> bool:
    """Whether the judge lets the row pass, by the tolerances of the project."""
    comparison = Comparison(COMPARISON_FORMAT, "hard", "Hard cases", images=(row,))
    verdicts = judge(comparison.subjects(), comparison.missing, read_tolerances(scene_root() / "tolerances.toml"))
    return exit_code(verdicts) == 0


def _nan_fails(nan: NDArray[np.float32], grey: NDArray[np.float32], mask: NDArray[np.bool_]) -> Claim:
    def check() -> Seen:
        row = compare_region(ImageResult(nan), ImageResult(grey), mask, "interior", NAMES)
        return Seen(not _passes(row), f"mean relative error {row.mean_relative_error_percent:.4g} %")

    return Claim("fails", "a picture that holds NaN is judged wrong", check)


def _unseen_region() -> Claim:
    def check() -> Seen:
        extra = '[[regions]]\nname = "roof"\nbox_m = [[0, 0, 90], [1, 1, 91]]'
        scene = replace(windowed_room(), extra=extra).load()
        names = list(region_masks(scene, scene.views[0]))
        return Seen("roof" not in names and "interior" in names, f"compared: {', '.join(names)}")

    return Claim("left out", "the region is not compared, the others are", check)


def _skies() -> list[Case]:
    def loaded(condition: str) -> Callable[[], object]:
        def act() -> Condition:
            scene: Scene = replace(windowed_room(), condition=condition).load()
            return resolve_condition(scene.conditions[0], scene.site)

        return act

    time = 'time = "2026-03-21T12:00"\n'
    lit = Lit(windowed_room())

    def relit_with(change: Callable[[Condition], Condition]) -> Callable[[], object]:
        return lambda: lit.engine.relight(change(lit.condition))

    nan = math.nan
    return [
        Case(
            "NaN in a condition's file",
            GROUP,
            (
                refused("Perez sky", loaded(time + 'sky = "perez:nan,nan"'), ("perez:nan,nan", "conditions[0].sky")),
                refused(
                    "zenith luminance",
                    loaded(time + "zenith_luminance_cd_m2 = nan"),
                    ("conditions[0].zenith_luminance_cd_m2", "nan", "finite"),
                ),
                refused(
                    "infinite illuminance",
                    loaded(time + "diffuse_horizontal_illuminance_lx = inf"),
                    ("conditions[0].diffuse_horizontal_illuminance_lx", "inf", "finite"),
                ),
                refused("albedo", loaded(time + "ground_albedo = nan"), ("conditions[0].ground_albedo", "finite")),
            ),
        ),
        Case(
            "NaN sky, made in code",
            GROUP,
            (
                refused("sky", relit_with(lambda c: replace(c, sky=replace(c.sky, scale=nan))), ("sky", "finite")),
                refused(
                    "infinite sky",
                    relit_with(lambda c: replace(c, sky=replace(c.sky, scale=math.inf))),
                    ("sky", "finite"),
                ),
                refused(
                    "sky's colour",
                    relit_with(lambda c: replace(c, sky_rgb=np.array([1.0, nan, 1.0]))),
                    ("sky", "finite"),
                ),
                refused(
                    "infinite colour", relit_with(lambda c: replace(c, sky_rgb=np.full(3, math.inf))), ("sky", "finite")
                ),
                refused(
                    "ground",
                    relit_with(lambda c: replace(c, ground_luminance_rgb=np.full(3, nan))),
                    ("ground", "finite"),
                ),
                refused(
                    "sun", relit_with(lambda c: replace(c, sun_illuminance_rgb=np.full(3, nan))), ("beam", "finite")
                ),
                refused("direction", relit_with(lambda c: replace(c, sun_direction=np.full(3, nan))), ("beam", "unit")),
                refused(
                    "direction of no length",
                    relit_with(lambda c: replace(c, sun_direction=np.zeros(3))),
                    ("beam", "unit"),
                ),
                _unchanged(lit),
            ),
        ),
        Case(
            "NaN sensor",
            GROUP,
            (
                refused(
                    "place",
                    lambda: lit.engine.illuminance(np.full((1, 3), nan), np.array([[0.0, 0.0, 1.0]])),
                    ("sensor", "0", "finite"),
                ),
                refused(
                    "normal",
                    lambda: lit.engine.illuminance(np.ones((1, 3)), np.zeros((1, 3))),
                    ("sensor", "0", "normal"),
                ),
            ),
        ),
    ]


def _unchanged(lit: Lit) -> Claim:
    """After the refusals above, which leave the engine in the light that it had."""

    def check() -> Seen:
        point, up = np.array([[2.0, 2.0, 0.8]]), np.array([[0.0, 0.0, 1.0]])
        found = lit.engine.illuminance(point, up)["total"]
        fresh = Lit(lambda: lit.scene).engine.illuminance(point, up)["total"]
        return Seen(bool(np.array_equal(found, fresh)), f"{found[0, 1]:.6g} lx, a fresh engine {fresh[0, 1]:.6g} lx")

    return Claim("keeps its light", "a refused condition changes nothing", check)
