"""What a renderer is: one protocol for the engine and for every reference, and what each returns."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from transom.daylight.condition import Condition
from transom.errors import InputError
from transom.scene.model import Scene, View

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Progress = Callable[[int, int], None]
"""Called as progress(done, total) in units of equal work."""


@dataclass(frozen=True)
class ImageResult:
    """A picture in linear RGB, Rec. 709, Y in cd/m².

    mean: (height, width, 3). halves: two independent estimates whose average is `mean`, or None without noise.
    standard_error: (height, width) of the luminance [cd/m²], or None without noise.
    components: pictures that add up to `mean` ("sun", "sky", "indirect", "emitted", "exterior"), where known.
    facts: what was done (samples, plan, seconds by phase), JSON values only.
    """

    mean: Float32
    halves: tuple[Float32, Float32] | None = None
    standard_error: Float32 | None = None
    components: Mapping[str, Float32] = field(default_factory=dict)
    facts: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class SensorResult:
    """Illuminance [lx] at N sensors as linear RGB whose Y is lux, (N, 3), and the standard error of Y (N,) [lx]."""

    illuminance: Float64
    standard_error: Float64
    facts: Mapping[str, Any] = field(default_factory=dict)


class Renderer(Protocol):
    """One way of finding the light of a scene. `version` is declared, and raised when answers may change."""

    name: str
    version: str

    def default_options(self) -> dict[str, Any]:
        """Options that change the answer, with their defaults; part of a run's key."""

    def render(
        self,
        scene: Scene,
        condition: Condition,
        view: View,
        options: Mapping[str, Any],
        progress: Progress | None = None,
    ) -> ImageResult: ...

    def illuminance(
        self,
        scene: Scene,
        condition: Condition,
        points: Float64,
        normals: Float64,
        options: Mapping[str, Any],
        progress: Progress | None = None,
    ) -> SensorResult: ...


RENDERERS: dict[str, str] = {
    "engine": "transom.engine_renderer:EngineRenderer",
    "mitsuba": "transom_reference.mitsuba_renderer:MitsubaRenderer",
    "radiance": "transom_reference.radiance_renderer:RadianceRenderer",
}


def load_renderer(name: str) -> Renderer:
    """The renderer of that name, imported only now. Raises InputError for an unknown name."""
    if name not in RENDERERS:
        raise InputError(
            "is not a renderer", field="--renderer", value=name, remedy=f"Choose one of {', '.join(RENDERERS)}"
        )
    module, _, attribute = RENDERERS[name].partition(":")
    renderer: Renderer = getattr(importlib.import_module(module), attribute)()
    return renderer
