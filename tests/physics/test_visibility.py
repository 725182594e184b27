"""Shadow volumes and shadow rays: two methods that must agree on every pixel away from the edges of shadows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter
from solved_scenes import ROOMS, solved

from transom.colour import luminance
from transom.engine import Engine, trace_primary
from transom.scene.model import View

WIDTH = 320
RELATIVE = 0.01
DISAGREEING_SHARE = 1e-4
"""Isolated pixels: the rasteriser's depth and a ray's distance on two sides of a sliver (shadow_volumes.h)."""


def sun_pictures(engine: Engine, view: View) -> tuple[np.ndarray, np.ndarray]:
    rays = engine.render(view, "rays", edge_samples=4)
    volumes = engine.render(view, "volumes", edge_samples=4)
    return luminance(rays.components["sun"]), luminance(volumes.components["sun"])


def away_from_edges(engine: Engine, view: View, sun: np.ndarray, floor: float) -> np.ndarray:
    """Pixels whose neighbours within one pixel show the same face, in nearly the same sunlight.

    Where surfaces end, the two methods test other places of a pixel: rays a turned grid, the rasteriser an upright one.
    """
    face, _, _ = trace_primary(engine.scene, view)
    one_surface = maximum_filter(face, 3) == minimum_filter(face, 3)
    return one_surface & (maximum_filter(sun, 3) - minimum_filter(sun, 3) < 0.1 * sun + floor)


@pytest.mark.parametrize("name", ROOMS)
def test_volumes_and_rays_agree_away_from_shadow_edges(name: str) -> None:
    engine = solved(name)
    for original in engine.scene.views:
        view = replace(original, width=WIDTH, height=WIDTH * original.height // original.width)
        rays, volumes = sun_pictures(engine, view)
        assert rays.max() > 0, "a view without sun tests nothing"
        floor = 0.01 * float(rays.max())
        flat = away_from_edges(engine, view, rays, floor)
        differ = np.abs(rays - volumes) > RELATIVE * rays + floor
        assert flat.mean() > 0.5
        assert (differ & flat).sum() <= max(1, DISAGREEING_SHARE * flat.sum()), f"{name}/{view.name}"
        assert differ.sum() <= 0.02 * differ.size, f"{name}/{view.name}: too many edge pixels differ"


def test_sizes_beyond_the_largest_stencil_mask_are_rendered() -> None:
    engine = solved("test_room")
    view = replace(engine.scene.views[0], width=1280, height=960)
    frame = engine.render(view, "volumes", edge_samples=4)
    assert frame.radiance.shape == (960, 1280, 3)
    assert np.isfinite(frame.radiance).all()
