"""Variants of a scene for speed sweeps: more panes of the same area, one pane alone, other products, edits."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from transom.daylight.condition import Condition
from transom.edits import with_object_moved, with_object_removed
from transom.fenestration.choice import choose_product, is_file
from transom.fenestration.light import panel_light
from transom.products import load_product
from transom.scene.model import Float64, Int32, Mesh, Opening, Scene

EditName = Literal["recolour", "reglaze", "move_object", "add_object", "remove_object"]

SHORT_MOVE_M, LONG_MOVE_M = 0.2, 0.3
"""Of an object, level and towards the middle of the scene, so that its extent stays."""

PANE_CLEARANCE_M = 0.05
"""Objects nearer to a pane belong to the window."""

LARGEST_SHARE = 0.25
"""Of the scene's bounding box: a larger object is the building."""

PATCH_TOLERANCE = 0.1
"""Of the patches wanted: what a trial may find more or fewer."""

MOST_TRIALS = 3
"""Of a target for the patches wanted; the last one is corrected once more, and not tried again."""


@dataclass(frozen=True)
class SceneEdit:
    """A scene that is solved, and scenes that it is edited to in turn."""

    before: Scene
    after: tuple[Scene, ...]


def target_for_patches(scene: Scene, wanted: int) -> int:
    """The `target_patch_count` of a solve that gives about `wanted` patches, by a few trials with few rays.

    The engine divides the area indoors by its target. Faces round up, the outdoors comes on top, and what light does
    not reach is left out: a room with much furniture has twice the patches, and none has fewer than its faces. Few rays
    miss some patches: the solve has 3 to 6 % more (measured in two rooms).
    """
    from transom.engine import Engine, SolveOptions

    target = wanted
    for _ in range(MOST_TRIALS):
        trial = SolveOptions(
            target_patch_count=target,
            elements_per_edge=1,
            patch_rays=16,
            patch_opening_rays=4,
            node_rays=16,
            node_opening_rays=4,
        )
        found = int(Engine.solve(scene, trial).facts()["patches"])
        if abs(found - wanted) <= PATCH_TOLERANCE * wanted:
            break
        target = max(1, round(target * wanted / found))
    return target


def scene_edits(scene: Scene) -> dict[EditName, SceneEdit]:
    """The edits that are timed, as far as the scene has what they change."""
    edits: dict[EditName, SceneEdit] = {
        "recolour": SceneEdit(scene, tuple(with_other_paint(scene, share) for share in (0.9, 0.8)))
    }
    if scene.openings:
        edits["reglaze"] = SceneEdit(scene, tuple(with_other_glass(scene, share) for share in (0.9, 0.8)))
    name = movable_object(scene)
    if name is not None:
        without = with_object_removed(scene, name)
        edits["move_object"] = SceneEdit(
            scene,
            tuple(with_object_moved(scene, name, _inwards(scene, name, by)) for by in (SHORT_MOVE_M, LONG_MOVE_M)),
        )
        edits["add_object"] = SceneEdit(without, (scene,))
        edits["remove_object"] = SceneEdit(scene, (without,))
    return edits


def movable_object(scene: Scene) -> str | None:
    """The closed object with the largest bounding box that is neither the building nor near a pane, if there is one."""
    mesh = scene.mesh
    is_opening = _is_opening(scene)
    panes = [_box(mesh, mesh.faces[face : face + 1]) for face in np.flatnonzero(is_opening)]
    whole = _volume(*_box(mesh, mesh.faces))
    sizes: dict[str, float] = {}
    for index, name in enumerate(mesh.objects):
        chosen = mesh.face_object == index
        if not chosen.any() or is_opening[chosen].any() or not _is_closed(mesh, mesh.faces[chosen]):
            continue
        low, high = _box(mesh, mesh.faces[chosen])
        is_near_pane = any(
            (low - PANE_CLEARANCE_M <= last).all() and (high + PANE_CLEARANCE_M >= first).all() for first, last in panes
        )
        if not is_near_pane and _volume(low, high) <= LARGEST_SHARE * whole:
            sizes[name] = _volume(low, high)
    return max(sizes, key=lambda name: sizes[name], default=None)


def opening_face_count(scene: Scene) -> int:
    """Faces of panes."""
    return int(_is_opening(scene).sum())


def with_panes(scene: Scene, split: int) -> Scene:
    """The scene with each four-cornered pane cut into split x split; split 0: every pane but the first is closed.

    Closed panes take the opaque material that most faces have. Cut panes keep their area and their group.
    """
    opening = _is_opening(scene)
    if split == 0:
        opaque = [index for index, material in enumerate(scene.materials) if material.opening < 0]
        counts = np.bincount(scene.mesh.face_material, minlength=len(scene.materials))
        wall = max(opaque, key=lambda index: counts[index])
        material = scene.mesh.face_material.copy()
        material[np.flatnonzero(opening)[1:]] = wall
        return replace(scene, mesh=replace(scene.mesh, face_material=material))
    return replace(scene, mesh=_cut(scene.mesh, opening & (scene.mesh.faces[:, 3] >= 0), split))


def with_other_glass(scene: Scene, share: float) -> Scene:
    """The scene with the visible transmittance of every glazed opening multiplied by `share` (up to 1)."""
    openings = tuple(
        entry
        if entry.glazing == "none"
        else replace(entry, visible_transmittance=max(share * entry.visible_transmittance, 1e-3))
        for entry in scene.openings
    )
    return replace(scene, openings=openings)


def beam_count(scene: Scene, condition: Condition) -> int:
    """Parallel lights of a condition: the sun, and the lobes of every panel group that it shines on."""
    if condition.sun_direction is None:
        return 0
    return 1 + sum(len(light.beams) for light in panel_light(scene, condition))


def has_changeable_product(scene: Scene) -> bool:
    """Whether an opening holds a product with parameters, not a file."""
    return any(_is_changeable(entry) for entry in scene.openings)


def with_other_product(scene: Scene, index: int) -> Scene:
    """The scene with the first parameter, a size, of its first changeable product greater by a thousandth, or by more
    for a greater index: a product that was never looked at before."""
    opening = next(entry for entry in scene.openings if _is_changeable(entry))
    assert opening.product is not None
    parameters = {**load_product(opening.product.name).record.parameters, **dict(opening.product.parameters)}
    first = next(iter(parameters))
    parameters[first] *= 1 + 1e-3 * (index + 1)
    product = choose_product(opening.product.name, parameters)
    openings = tuple(replace(entry, product=product) if entry is opening else entry for entry in scene.openings)
    return replace(scene, openings=openings)


def _is_changeable(opening: Opening) -> bool:
    """Whether it holds a product with parameters, which a file and a unit cell of triangles have not."""
    if opening.product is None or is_file(opening.product.name):
        return False
    return bool(load_product(opening.product.name).record.parameters)


def with_other_paint(scene: Scene, share: float) -> Scene:
    """The scene with the reflectance of its first opaque material multiplied by `share` (up to 1)."""
    index = next(index for index, material in enumerate(scene.materials) if material.opening < 0)
    red, green, blue = scene.materials[index].reflectance
    materials = list(scene.materials)
    materials[index] = replace(materials[index], reflectance=(share * red, share * green, share * blue))
    return replace(scene, materials=tuple(materials))


def _inwards(scene: Scene, name: str, distance_m: float) -> tuple[float, float, float]:
    """An offset of an object along x, towards the middle of the scene."""
    mesh = scene.mesh
    low, high = _box(mesh, mesh.faces[mesh.face_object == mesh.objects.index(name)])
    first, last = _box(mesh, mesh.faces)
    return (distance_m if low[0] + high[0] < first[0] + last[0] else -distance_m, 0.0, 0.0)


def _box(mesh: Mesh, faces: Int32) -> tuple[Float64, Float64]:
    """Least and greatest coordinates (3,) [m]."""
    points = mesh.vertices[faces[faces >= 0]]
    return points.min(axis=0), points.max(axis=0)


def _volume(low: Float64, high: Float64) -> float:
    return float(np.prod(high - low))


def _is_closed(mesh: Mesh, faces: Int32) -> bool:
    """Whether every edge is met by as many faces one way as the other, and encloses something."""
    edges: Counter[tuple[bytes, bytes]] = Counter()
    for face in faces:
        corners = [mesh.vertices[corner].round(6).tobytes() for corner in face if corner >= 0]
        for start, end in zip(corners, [*corners[1:], corners[0]], strict=True):
            edges[min(start, end), max(start, end)] += 1 if start < end else -1
    return not any(edges.values()) and _volume(*_box(mesh, faces)) > 0


def _is_opening(scene: Scene) -> NDArray[np.bool_]:
    is_opening = np.array([material.opening >= 0 for material in scene.materials])
    return np.asarray(is_opening[scene.mesh.face_material])


def _cut(mesh: Mesh, chosen: NDArray[np.bool_], split: int) -> Mesh:
    """The mesh with the chosen quads cut into split x split quads, appended after the others."""
    kept = np.flatnonzero(~chosen)
    steps = np.linspace(0.0, 1.0, split + 1)
    vertices, faces, sources = [mesh.vertices], [mesh.faces[kept]], [kept]
    count = len(mesh.vertices)
    for face in np.flatnonzero(chosen):
        a, b, c, d = mesh.vertices[mesh.faces[face]]
        u, v = (grid[..., None] for grid in np.meshgrid(steps, steps, indexing="ij"))
        points = (1 - u) * (1 - v) * a + u * (1 - v) * b + u * v * c + (1 - u) * v * d
        index = count + np.arange((split + 1) ** 2).reshape(split + 1, split + 1)
        quads = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1).reshape(-1, 4)
        vertices.append(points.reshape(-1, 3))
        faces.append(quads.astype(np.int32))
        sources.append(np.full(split**2, face))
        count += (split + 1) ** 2
    source = np.concatenate(sources)
    return replace(
        mesh,
        vertices=np.concatenate(vertices),
        faces=np.concatenate(faces).astype(np.int32),
        face_material=mesh.face_material[source],
        face_object=mesh.face_object[source],
        corner_normals=None if mesh.corner_normals is None else mesh.corner_normals[source],
    )
