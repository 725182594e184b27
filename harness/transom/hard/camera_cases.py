"""Cameras where pictures go wrong: in shadow, in walls and solids, against surfaces, on panes, outdoors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from transom.hard.changes import sunlit
from transom.hard.claims import Case, Claim, Lit, Seen, finite, methods_agree, refused
from transom.hard.rooms import ROOM_M, Point, Room, box, windowed_room
from transom.scene.model import Scene

GROUP = "camera"
SUN = (0.1, -1.0, 0.6)


def camera_cases() -> list[Case]:
    x, y, _ = ROOM_M
    return [
        _case("camera inside a shadow volume", (2.0, 1.7, 0.5), (2.0, 3.5, 0.0)),
        _case("camera inside a shadow volume, looking into the sun", (2.0, 1.9, 0.5), (1.9, 0.9, 1.1)),
        _case("camera in a wall", (2.0, y, 1.5), (2.0, 0.0, 1.0)),
        _case("camera in a wall, looking along it", (0.0, y, 1.5), (0.0, 0.0, 1.0)),
        _case("camera inside a solid", (2.0, 1.2, 0.8), (2.0, 4.0, 0.5)),
        _case("camera 1 mm before a surface", (x - 1e-3, 2.5, 1.0), (x, 2.5, 0.9)),
        _case("camera 1 micrometre before a surface", (x - 1e-6, 2.5, 1.0), (x, 2.5, 1.0)),
        _case("camera 1 mm above a sunlit floor", (2.0, 3.0, 1e-3), (2.0, 0.0, 0.0)),
        _case("camera on the pane", (2.0, 0.0, 1.7), (2.0, 4.0, 0.5)),
        _case("camera outdoors", (2.0, -3.0, 1.7), (2.0, 4.0, 1.0)),
        _case("camera 1 mm off a corner", (1e-3, 1e-3, 1e-3), (x, y, 2.0)),
        _case("camera 0.1 mm off a silhouette", (2.5001, 1.5001, 1.0001), (2.0, 3.5, 0.0)),
        _touching("camera in a corner", (0.0, 0.0, 0.0), (x, y, 2.0)),
        _touching("camera at a corner of a silhouette", (2.5, 1.5, 1.0), (2.0, 3.5, 0.0)),
        _refused("camera that looks nowhere", lambda r: replace(r, target=r.camera), ("target_m", "views[0]", "Move")),
        _refused(
            "camera that looks along its up",
            lambda r: replace(r, target=(r.camera[0], r.camera[1], 0.0)),
            ("up", "views[0]", "Give a direction"),
        ),
        _refused("camera at no place", lambda r: replace(r, camera=(float("nan"), 0.0, 0.0)), ("position_m", "finite")),
        _refused_by_engine(),
    ]


def camera_room(camera: Point, target: Point) -> Room:
    room = windowed_room().with_polygons(*box((1.5, 0.8, 0.6), (2.5, 1.5, 1.0)))
    return replace(room, camera=camera, target=target)


def _case(name: str, camera: Point, target: Point) -> Case:
    lit = Lit(camera_room(camera, target), lambda condition: sunlit(condition, SUN))
    return Case(name, GROUP, (finite(lit), methods_agree(lit), _parts(lit)))


def _touching(name: str, camera: Point, target: Point) -> Case:
    """Cameras at a vertex of the mesh: which of its faces they see has no answer, and the two methods may differ."""
    lit = Lit(camera_room(camera, target), lambda condition: sunlit(condition, SUN))
    return Case(name, GROUP, (finite(lit), _parts(lit)))


def _parts(lit: Lit) -> Claim:
    def check() -> Seen:
        frame = lit.picture()
        error = float(abs(frame.radiance - sum(frame.components.values())).max())
        return Seen(error <= 1e-3 * max(float(frame.radiance.max()), 1.0), f"largest difference {error:.3g} cd/m²")

    return Claim("parts add up", "components add up to the picture", check)


def _refused(name: str, change: Callable[[Room], Room], words: tuple[str, ...]) -> Case:
    return Case(name, GROUP, (refused("refused", lambda: change(windowed_room()).load(), words),))


def _refused_by_engine() -> Case:
    """A view made in code, past the checks of the file."""
    lit = Lit(windowed_room())

    def look(scene: Scene, position: Point) -> object:
        return lit.engine.render(replace(scene.views[0], position=position))

    nan = float("nan")
    return Case(
        "camera at no place, made in code",
        GROUP,
        (refused("refused", lambda: look(lit.scene, (nan, nan, nan)), ("views.inside", "camera")),),
    )
