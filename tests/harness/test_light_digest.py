"""Keys of runs hold what products make of light, and nothing new where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from transom.bundle import make_case
from transom.daylight.condition import resolve_condition
from transom.fenestration import light
from transom.fenestration.light import light_digest
from transom.fenestration.reglazing import reglazed
from transom.fenestration.through import SunThrough
from transom.renderer import load_renderer
from transom.scene import load_scene
from transom.scene.model import ProductChoice, Scene

SCENE = load_scene("test_room")
CONDITION = resolve_condition(SCENE.conditions[0], SCENE.site)
PRISMS = reglazed(SCENE, ["south_upper=prismatic_panel"])


def chosen(scene: Scene) -> ProductChoice:
    (product,) = [opening.product for opening in scene.openings if opening.product is not None]
    return product


def test_scenes_without_products_keep_the_keys_that_they_had() -> None:
    case = make_case(SCENE, CONDITION, load_renderer("mitsuba"), {}, view=SCENE.views[0])
    assert light_digest(SCENE, CONDITION) is None
    assert "fenestration" not in case.inputs()


def test_products_facet_angles_and_suns_are_other_light() -> None:
    noon = resolve_condition(next(c for c in SCENE.conditions if c.name == "mar21_1200"), SCENE.site)
    others = [reglazed(SCENE, [f"south_upper={name}"]) for name in ("prismatic_panel(angle_low=43)", "laser_cut_panel")]
    digests = [light_digest(scene, CONDITION) for scene in (PRISMS, *others)] + [light_digest(PRISMS, noon)]
    assert len(set(digests)) == 4
    assert None not in digests


def test_a_product_traced_to_other_light_is_another_question(monkeypatch: pytest.MonkeyPatch) -> None:
    before = light_digest(PRISMS, CONDITION)
    product = light.load_fenestration(chosen(PRISMS))
    through = product.sun(np.array([0.0, 0.0, 1.0]))

    class Dimmer:
        basis = product.basis

        def sun(self, _incident: object) -> SunThrough:
            return SunThrough(through.lobes, 0.9 * through.residual + 1e-3)

    monkeypatch.setattr(light, "load_fenestration", lambda _choice: Dimmer())
    assert light_digest(PRISMS, CONDITION) != before
