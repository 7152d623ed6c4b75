"""Numbers as people read them: to the digits that their error justifies, in groups of three, with units.

>>> numeral(5386.23, 9.7), with_error(0.030018, 0.00012), interval(0.02941, 0.03059, 0.0003)
('5386.2', '0.03002 ± 0.00012', '0.02941 to 0.03059')
>>> unit_text("kg m^2")
'kg m²'

Very large and very small numbers have a power of ten, a pair of them one in common.
"""

from math import floor, isfinite, isinf, log10

MINUS = "\u2212"
"""A minus as long as a plus."""

DASH = "\u2013"
"""Stands where there is no number, or no unit."""

_NARROW_SPACE = "\u202f"
_TIMES = "\u00d7"
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PLAIN = (-4, 5)
"""Powers of ten of numbers that are written out."""


def numeral(value: float, error: float) -> str:
    """``value`` to the second significant digit of ``error``; to four digits of its own where that is unknown.

    Both are in the same unit.
    """
    return _scaled("{}", (value,), error)


def with_error(value: float, error: float) -> str:
    """A value and its error in the same unit, both to the second significant digit of the error."""
    return _scaled("{} ± {}", (value, error), error)


def interval(low: float, high: float, error: float) -> str:
    """Two ends of an interval, to the second significant digit of ``error``. All are in the same unit."""
    return _scaled("{} to {}", (low, high), error)


def _scaled(form: str, values: tuple[float, ...], error: float) -> str:
    """``values`` in ``form``, with a power of ten in common where they are very large or very small."""
    known = [abs(value) for value in values if isfinite(value)]
    largest = max(known, default=0.0)
    power = floor(log10(largest)) if largest > 0.0 else 0
    last = floor(log10(error)) - 1 if isfinite(error) and error > 0.0 else power - 3
    if _PLAIN[0] <= power <= _PLAIN[1]:
        return form.format(*(_grouped(value, -last) for value in values))
    text = form.format(*(_grouped(value / 10.0**power, power - last) for value in values))
    whole = f"({text})" if len(values) > 1 else text
    return f"{whole} {_TIMES} 10{str(power).translate(_SUPERSCRIPTS)}"


def _grouped(value: float, places: int) -> str:
    """With so many decimals, and thousands apart from ten thousand on."""
    if not isfinite(value):
        return (f"{MINUS}∞" if value < 0.0 else "∞") if isinf(value) else "unknown"
    text = f"{value:,.{min(max(places, 0), 12)}f}"
    return text.replace(",", _NARROW_SPACE if abs(value) >= 1e4 else "").replace("-", MINUS)


def percentage(share: float, places: int = 1) -> str:
    """A share as a percentage, 100 only if it is the whole; a dash where there is none."""
    if not isfinite(share):
        return DASH
    if share < 1.0 and round(100.0 * share, places) == 100.0:
        return f"> {100.0 - 10.0**-places:.{places}f} %"
    return f"{100.0 * share:.{places}f} %".replace("-", MINUS)


def decimal(number: float, places: int) -> str:
    """A number of any unit with so many decimals; a dash where there is none."""
    return _grouped(number, places) if isfinite(number) else DASH


def count(number: float) -> str:
    """A whole number [1] in groups of three; a dash where there is none."""
    return _grouped(round(number), 0) if isfinite(number) else DASH


def signed(value: float, places: int) -> str:
    """A number of any unit with its sign, none if it rounds to zero; a dash where there is no number."""
    if not isfinite(value):
        return DASH
    rounded = round(value, places)
    return f"{rounded:+.{places}f}".replace("-", MINUS) if rounded else f"{0.0:.{places}f}"


def unit_text(unit: str) -> str:
    """A unit as it is printed, a dash for a number without one."""
    return DASH if unit == "1" else unit.replace("^2", "²").replace("^3", "³")
