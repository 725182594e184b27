"""The same scene with other glazing in an opening: how products are compared."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Sequence
from pathlib import Path

from transom.errors import InputError
from transom.fenestration.choice import choose_product, is_file
from transom.glass import MAX_TRANSMITTANCE
from transom.scene import load_scene
from transom.scene.model import Opening, ProductChoice, Scene

CLEAR = re.compile(r"clear(?::(?P<transmittance>[0-9.]+))?")
PRODUCT = re.compile(r"(?P<name>[^()]+?)\s*(?:\((?P<parameters>[^()]*)\))?")


def load_glazed(name: str, glazings: Sequence[str] = ()) -> Scene:
    """The scene of that name or folder, with glazing replaced (`reglazed`)."""
    return reglazed(load_scene(name), glazings)


def reglazed(scene: Scene, glazings: Sequence[str]) -> Scene:
    """The scene with each "OPENING=GLAZING" in place of what the opening had, under a name that says so;
    the scene itself without any.

    GLAZING: "none", "clear" or "clear:0.82" (visible transmittance; without it the best pane there is), a product such
    as "prismatic_panel" or "prismatic_panel(angle_low=30, angle_high=60)", or the path of a BSDF file.
    Raises InputError for an unknown opening, product or parameter.
    """
    if not glazings:
        return scene
    openings = list(scene.openings)
    replaced = dict(text.split("=", 1) for text in scene.glazings)
    for text in glazings:
        name, equals, glazing = (part.strip() for part in text.partition("="))
        known = [opening.name for opening in scene.openings]
        if not equals or not glazing or name not in known:
            raise InputError(
                "is not OPENING=GLAZING with an opening of the scene",
                file=scene.file,
                field="glazing",
                value=text,
                remedy=f"Openings of the scene: {', '.join(known) or 'none'}. Write such as NAME=prismatic_panel",
            )
        index = known.index(name)
        openings[index] = _glazed(openings[index], glazing)
        replaced[name] = glazing
    base = scene.variant_of or scene.name
    by_name = {opening.name: opening for opening in openings}
    labels = [f"{name}-{_label(by_name[name], glazing)}" for name, glazing in replaced.items()]
    return dataclasses.replace(
        scene,
        name="-".join([base, *labels]),
        title="; ".join([scene.title, *(f"{name.replace('_', ' ')}: {text}" for name, text in replaced.items())]),
        openings=tuple(openings),
        variant_of=base,
        glazings=tuple(f"{name}={glazing}" for name, glazing in replaced.items()),
    )


def _label(opening: Opening, glazing: str) -> str:
    """A glazing as a part of a file's name: a file by its stem and its content's digest."""
    if opening.product and is_file(opening.product.name):
        glazing = f"{Path(opening.product.name).stem}_{opening.product.digest[:8]}"
    return re.sub(r"[^A-Za-z0-9_-]+", "_", glazing).strip("_")


def _glazed(opening: Opening, glazing: str) -> Opening:
    if glazing == "none":
        return dataclasses.replace(opening, glazing="none", visible_transmittance=1.0, product=None)
    clear = CLEAR.fullmatch(glazing)
    if clear:
        share = float(clear["transmittance"] or MAX_TRANSMITTANCE)
        if not 0 <= share <= MAX_TRANSMITTANCE:
            problem = f"has a transmittance outside 0..{MAX_TRANSMITTANCE:.4f}"
            raise InputError(problem, field=f"glazing of {opening.name}", value=glazing)
        return dataclasses.replace(opening, glazing="clear", visible_transmittance=share, product=None)
    product = named_product(glazing, f"glazing of {opening.name}")
    return dataclasses.replace(opening, glazing="product", visible_transmittance=0.0, product=product)


def named_product(text: str, field: str = "product") -> ProductChoice:
    """A product as it is written: its name, with parameters in brackets, or a BSDF file. Raises InputError."""
    found = PRODUCT.fullmatch(text.strip())
    if not found:
        raise InputError(
            "is not a glazing",
            field=field,
            value=text,
            remedy="Write none, clear:0.82, a product such as prismatic_panel(angle_low=30), or a BSDF file",
        )
    return choose_product(found["name"], _parameters(found["parameters"] or "", text))


def _parameters(text: str, glazing: str) -> dict[str, float]:
    parameters = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, equals, value = (word.strip() for word in part.partition("="))
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not equals or not math.isfinite(number):
            remedy = "Such as prismatic_panel(angle_low=30)"
            raise InputError(f"has {part!r}, which is not NAME=NUMBER", field="glazing", value=glazing, remedy=remedy)
        parameters[name] = number
    return parameters
