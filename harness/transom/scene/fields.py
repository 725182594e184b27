"""The kinds of value that scene.toml holds, each with its allowed range and the sentence that explains a wrong one."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from datetime import datetime
from typing import Annotated, Any

from pydantic import PlainValidator
from pydantic_core import PydanticCustomError

Vector = tuple[float, float, float]


def fail(problem: str, remedy: str = "", field: str = "", value: object = None) -> PydanticCustomError:
    """The error a validator raises: `problem` follows `field = value`, `remedy` is a sentence of its own.

    Validators of whole tables name the `field` of the table, and the `value` found there.
    """
    context = {"problem": problem, "remedy": remedy, "field": field, "value": value}
    return PydanticCustomError("transom", "{problem}", context)


def is_number(value: object) -> bool:
    """Whether TOML gave an integer or a float; booleans and text are not numbers."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def check_number(value: object, low: float, high: float, meaning: str, below: bool = False) -> float:
    """`value` as a float within low..high (`below`: less than high). Raises the field's error otherwise."""
    if not is_number(value):
        raise fail(f"is not a number ({meaning})", "Write a number without quotes" if isinstance(value, str) else "")
    number = float(value)  # type: ignore[arg-type]
    if not math.isfinite(number):
        raise fail(f"is not a finite number ({meaning})")
    if number < low or number > high or (below and number >= high):
        raise fail(f"is outside {_span(low, high, below)} ({meaning})", _likely_share(number, high))
    return number


def _span(low: float, high: float, below: bool) -> str:
    if math.isinf(high):
        return f"{low:g} and above" if math.isfinite(low) else "the real numbers"
    return f"{low:g}..{high:g}" + (f", {high:g} excluded" if below else "")


def _likely_share(number: float, high: float) -> str:
    """For shares (0..1): the number that was probably meant, as a misplaced point or a percentage."""
    if not 0.99 < high <= 1.0 or not 1.0 < number <= 100.0:
        return ""
    return f"Did you mean {number / 10 if number < 10 else number / 100:.6g}?"


def number(low: float, high: float, meaning: str) -> PlainValidator:
    """A number in low..high, ends included."""
    return PlainValidator(lambda value: check_number(value, low, high, meaning))


def positive(meaning: str, high: float = math.inf) -> PlainValidator:
    """A number above 0 and at most `high`."""

    def check(value: object) -> float:
        found = check_number(value, -math.inf, math.inf, meaning)
        if not 0.0 < found <= high:
            raise fail(f"must be above 0{'' if math.isinf(high) else f' and at most {high:g}'} ({meaning})")
        return found

    return PlainValidator(check)


def whole(low: int, high: int, meaning: str) -> PlainValidator:
    """A whole number in low..high."""

    def check(value: object) -> int:
        if not isinstance(value, int) or isinstance(value, bool):
            raise fail(f"is not a whole number ({meaning})")
        if not low <= value <= high:
            raise fail(f"is outside {low}..{high} ({meaning})")
        return value

    return PlainValidator(check)


def rgb(low: float, high: float, meaning: str, below: bool = False) -> PlainValidator:
    """One number for grey, or three: linear red, green, blue with Rec. 709 primaries."""

    def check(value: object) -> Vector:
        if is_number(value):
            grey = check_number(value, low, high, meaning, below)
            return (grey, grey, grey)
        if not isinstance(value, list) or len(value) != 3:
            raise fail(f"is neither a number nor [red, green, blue] ({meaning})")
        red, green, blue = (check_number(part, low, high, meaning, below) for part in value)
        return (red, green, blue)

    return PlainValidator(check)


def check_vector(value: object) -> Vector:
    """[x, y, z] of finite numbers."""
    if not isinstance(value, list) or len(value) != 3:
        raise fail("is not a list of three numbers", "Write [x, y, z]")
    x, y, z = (check_number(part, -math.inf, math.inf, "coordinate") for part in value)
    return (x, y, z)


def check_direction(value: object) -> Vector:
    """[x, y, z], not all zero; returned with unit length."""
    vector = check_vector(value)
    length = math.hypot(*vector)
    if length < 1e-9:
        raise fail("has no direction", "Write for example [0, 0, 1] for upwards")
    return (vector[0] / length, vector[1] / length, vector[2] / length)


def one_of(*allowed: str, meaning: str) -> PlainValidator:
    """One of the words `allowed`."""

    def check(value: object) -> str:
        if value not in allowed:
            words = ", ".join(f'"{word}"' for word in allowed)
            raise fail(f"is not {meaning}", f"Allowed: {words}")
        return str(value)

    return PlainValidator(check)


def check_text(value: object) -> str:
    """Text of at least one character."""
    if not isinstance(value, str):
        raise fail("is not text", "Put it in quotes")
    if not value.strip():
        raise fail("is empty")
    return value


def check_name(value: object) -> str:
    """A name that can stand on a command line and in a file name."""
    text = check_text(value)
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]*", text):
        raise fail("is not a name", "Use letters, digits, '_', '-' and '.', without spaces")
    return text


def check_time(value: object) -> str:
    """Civil standard time without a zone, "2026-03-21T10:00" (seconds allowed)."""
    remedy = 'Write civil standard time in quotes, like "2026-03-21T10:00"'
    if not isinstance(value, str):
        raise fail("is not a time", remedy)
    if not re.fullmatch(r"\d{4}-\d{2}-\d{2}T\d{2}:\d{2}(:\d{2})?", value):
        raise fail("is not a time", remedy)
    try:
        datetime.fromisoformat(value)
    except ValueError as error:
        raise fail(f"is not a time ({error})", remedy) from None
    return value


def listed(check: Callable[[Any], Any], meaning: str) -> PlainValidator:
    """A list of at least one value that `check` accepts."""

    def check_all(value: object) -> tuple[Any, ...]:
        if not isinstance(value, list) or not value:
            raise fail(f"is not a list of {meaning}")
        return tuple(check(part) for part in value)

    return PlainValidator(check_all)


def check_switch(value: object) -> bool:
    """true or false."""
    if not isinstance(value, bool):
        raise fail("is neither true nor false", "Write true or false without quotes")
    return value


Switch = Annotated[bool, PlainValidator(check_switch)]
Text = Annotated[str, PlainValidator(check_text)]
Name = Annotated[str, PlainValidator(check_name)]
Point = Annotated[Vector, PlainValidator(check_vector)]
Direction = Annotated[Vector, PlainValidator(check_direction)]
Time = Annotated[str, PlainValidator(check_time)]
