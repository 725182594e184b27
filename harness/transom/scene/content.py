"""The content key: a hash of everything in a scene that changes its light, and of nothing else."""

from __future__ import annotations

import hashlib
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from transom.scene.model import Scene

KEY_FORMAT = 1
"""Raised when the same scene would hash differently."""

NORMAL_STEPS = 2**24
"""Parts of 1 to which shading normals count: processors differ in the last bit of the angles that weight them."""


def content_key(scene: Scene) -> str:
    """SHA-256 (64 hex digits) of geometry, shading normals, materials, openings and point sources.

    Names, texts, views, conditions, regions and sensors do not count: a run's own key holds those it depends on.
    The same scene gives the same key on every machine.
    """
    mesh = scene.mesh
    digest = hashlib.sha256(f"transom scene {KEY_FORMAT}".encode())
    arrays: dict[str, tuple[NDArray[Any] | None, str]] = {
        "vertices": (mesh.vertices, "<f8"),
        "faces": (mesh.faces, "<i4"),
        "face_material": (mesh.face_material, "<i4"),
        "corner_normals": (mesh.corner_normals, "<f8"),
    }
    for name, (array, kind) in arrays.items():
        if array is None:
            continue
        # Adding zero turns -0.0 into 0.0, which is the same place.
        exact = np.rint(array * NORMAL_STEPS) / NORMAL_STEPS if name == "corner_normals" else array
        plain = np.ascontiguousarray(exact + 0, dtype=np.dtype(kind))
        digest.update(f"{name}{plain.shape}".encode())
        digest.update(plain.tobytes())
    lights = {
        "materials": [(m.reflectance, m.luminance, m.smooth, m.opening) for m in scene.materials],
        "openings": [
            (o.glazing, o.visible_transmittance, *([o.product.digest] if o.product else [])) for o in scene.openings
        ],
        "point_sources": [(p.position, p.intensity) for p in scene.point_sources],
    }
    digest.update(json.dumps(lights, sort_keys=True).encode())
    return digest.hexdigest()
