"""The settings of a solve, in Python and in the engine."""

from __future__ import annotations

import numpy as np
import pytest

from transom import _engine
from transom.engine import SolveOptions

ENGINE = _engine.SolveOptions()


@pytest.mark.parametrize(
    ("name", "of_engine"),
    [
        ("maximum_edge_m", ENGINE.maximum_edge_m),
        ("target_patch_count", ENGINE.target_patch_count),
        ("elements_per_edge", ENGINE.elements_per_edge),
        ("patch_rays", ENGINE.patch_samples.hemisphere),
        ("patch_opening_rays", ENGINE.patch_samples.openings),
        ("node_rays", ENGINE.node_samples.hemisphere),
        ("node_opening_rays", ENGINE.node_samples.openings),
        ("panel_rays", ENGINE.panel_rays),
        ("node_tolerance", ENGINE.node_tolerance),
        ("tolerance", ENGINE.tolerance),
        ("seed", ENGINE.seed),
    ],
)
def test_a_default_is_that_of_the_engine(name: str, of_engine: float) -> None:
    assert np.float32(getattr(SolveOptions(), name)) == np.float32(of_engine)
