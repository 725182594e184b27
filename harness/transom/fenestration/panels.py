"""Panels: faces of an opening that holds a product, by orientation, and the frame in which the product sees light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from transom.scene.model import Scene

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

SAME_NORMAL_DIGITS = 4
"""Decimals to which the normals of one group agree: about 0.01 degrees."""

NEARLY_HORIZONTAL = 0.999
"""|z| of a normal from which a panel counts as lying: its y axis then points north."""


@dataclass(frozen=True)
class PanelGroup:
    """Faces of one opening that look the same way.

    opening: index into Scene.openings. normal: unit, towards outdoors (3,). axes: (3, 3), rows x, y, z of the product's
    frame in the world: x to the right and y up as seen from the room, z into it. faces: rows of Mesh.faces.
    """

    opening: int
    normal: Float64
    axes: Float64
    faces: Int64

    def to_panel(self, directions: Float64) -> Float64:
        """World directions (..., 3) in the product's frame."""
        return np.asarray(directions @ self.axes.T)

    def to_world(self, directions: Float64) -> Float64:
        """Directions (..., 3) of the product's frame in the world."""
        return np.asarray(directions @ self.axes)


def panel_groups(scene: Scene) -> tuple[PanelGroup, ...]:
    """Groups of all openings that hold a product: by opening, then in the order of their first face."""
    mesh = scene.mesh
    opening_of_face = np.array([material.opening for material in scene.materials], dtype=np.int64)[mesh.face_material]
    groups: list[PanelGroup] = []
    for index, opening in enumerate(scene.openings):
        if opening.product is None:
            continue
        faces = np.flatnonzero(opening_of_face == index)
        a, b, c = (mesh.vertices[mesh.faces[faces, corner]] for corner in range(3))
        normals = np.cross(b - a, c - a)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        rounded = [tuple(row) for row in np.round(normals, SAME_NORMAL_DIGITS) + 0.0]
        for key in dict.fromkeys(rounded):
            chosen = np.array([row == key for row in rounded])
            normal = normals[np.flatnonzero(chosen)[0]]
            groups.append(PanelGroup(index, normal, panel_axes(normal), faces[chosen]))
    return tuple(groups)


def panel_axes(normal: Float64) -> Float64:
    """Rows x, y, z of a product's frame in the world (3, 3), for the unit normal towards outdoors.

    y is the steepest way up in the panel; in a lying one, whose steepest way is not defined, it is north.
    """
    into_room = -np.asarray(normal, np.float64)
    up = np.array([0.0, 1.0, 0.0]) if abs(into_room[2]) > NEARLY_HORIZONTAL else np.array([0.0, 0.0, 1.0])
    y = up - (up @ into_room) * into_room
    y /= np.linalg.norm(y)
    return np.stack([np.cross(y, into_room), y, into_room])
