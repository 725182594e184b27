"""Numbers as text: rounded to what is known of them, with narrow spaces between thousands and a true minus sign."""

from __future__ import annotations

import math

THIN = "\N{NARROW NO-BREAK SPACE}"
MINUS = "\N{MINUS SIGN}"
NOTHING = "\N{EN DASH}"


def fixed(value: float | None, digits: int = 1) -> str:
    """A number with so many decimals."""
    if value is None or not math.isfinite(value):
        return NOTHING
    text = f"{abs(value):,.{digits}f}".replace(",", THIN)
    return (MINUS if value < 0 and float(f"{value:.{digits}f}") != 0 else "") + text


def signed(value: float | None, digits: int = 1) -> str:
    """The same with its sign always shown, except for zero."""
    text = fixed(value, digits)
    return "+" + text if value is not None and value > 0 and float(f"{value:.{digits}f}") != 0 else text


def rounded(value: float | None, uncertainty: float, most_digits: int = 2) -> str:
    """Rounded to the first significant digit of its standard uncertainty, with `most_digits` decimals at most."""
    return fixed(value, decimals_of(uncertainty, most_digits))


def decimals_of(uncertainty: float, most_digits: int = 2) -> int:
    """Decimals that a value with this standard uncertainty deserves: 0.03 -> 2, 4 -> 0."""
    if uncertainty <= 0 or not math.isfinite(uncertainty):
        return most_digits
    return max(0, min(most_digits, -math.floor(math.log10(uncertainty))))


def seconds(value: float | None) -> str:
    """A time with three significant digits in s, ms or µs."""
    if value is None or not math.isfinite(value):
        return NOTHING
    for factor, unit in ((1.0, "s"), (1e3, "ms"), (1e6, "µs")):
        scaled = value * factor
        if scaled >= 1 or unit == "µs":
            break
    digits = max(0, 2 - math.floor(math.log10(scaled))) if scaled > 0 else 0
    return f"{fixed(scaled, digits)}{THIN}{unit}"


def words(name: str) -> str:
    """A scene's or region's name for people: partition_office -> Partition office."""
    text = name.replace("_", " ").strip()
    return text[:1].upper() + text[1:]
