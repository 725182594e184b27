"""Solved scenes, one at a time: each is solved once for all tests that look at it."""

from __future__ import annotations

from functools import lru_cache

from transom.daylight import resolve_condition
from transom.engine import Engine
from transom.scene import load_scene

ROOMS = ("test_room", "desk_office", "partition_office", "deflector_house")
KNOWN = ("cube", "furnace", "three_tone")


@lru_cache(maxsize=len(ROOMS) + len(KNOWN))
def solved(name: str) -> Engine:
    """The scene with the engine's default options, lit by its main condition."""
    scene = load_scene(name)
    engine = Engine.solve(scene)
    engine.relight(resolve_condition(scene.conditions[0], scene.site))
    return engine
