"""Light is neither lost nor made: form factors and flux, on every scene that is shipped."""

from __future__ import annotations

import numpy as np
import pytest
from solved_scenes import KNOWN, ROOMS, solved


@pytest.mark.parametrize("name", ROOMS + KNOWN)
def test_form_factors_are_reciprocal_and_their_rows_sum_to_one(name: str) -> None:
    engine = solved(name)
    begin, column, value, area = engine.form_factors()
    row = np.repeat(np.arange(len(area)), np.diff(begin))
    sums = np.bincount(row, weights=value, minlength=len(area))
    facts = engine.facts()
    interior_rows = np.sort(np.abs(sums - 1))[: facts["interior_patches"]]
    assert interior_rows.max() < 1e-5
    flux = {(i, j): area[i] * f for i, j, f in zip(row[:20000], column[:20000], value[:20000], strict=True)}
    pairs = [(flux[i, j], flux[j, i], max(area[i], area[j])) for i, j in flux if (j, i) in flux]
    assert pairs
    assert max(abs(forth - back) / scale for forth, back, scale in pairs) < 1e-5
    assert facts["form_factor_defects"]["reciprocity"] < 1e-5
    assert facts["form_factor_defects"]["raw_reciprocity"] > 0, (
        "sampled form factors cannot be reciprocal by themselves"
    )


@pytest.mark.parametrize("name", ROOMS + KNOWN)
def test_flux_in_is_flux_absorbed_and_out(name: str) -> None:
    audit = solved(name).audit()
    assert (audit.absorbed + audit.out).sum() > 0
    assert abs(audit.imbalance) < 1e-3


@pytest.mark.parametrize("name", ROOMS)
def test_no_ray_slips_out_of_a_room(name: str) -> None:
    assert solved(name).facts()["leak_share"] < 1e-5
