"""Units of recorded signals: those of test labs by a table, any other by Pint.

The table comes first, for test labs mean an acceleration by ``g``. A unit has a dimension: a deflection in seconds is
an error.

>>> find_unit("MM").factor, factor_between("mT", "T"), factor_between("s", "m")
(0.001, 0.001, None)
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from math import isfinite, pi
from tokenize import TokenError
from types import MappingProxyType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pint

STANDARD_GRAVITY = 9.80665
"""Standard acceleration of free fall [m/s^2] (ISO 80000-3)."""


@dataclass(frozen=True)
class Unit:
    """``factor`` turns a number in this unit into SI; ``dimension`` is what it measures."""

    factor: float
    dimension: str


_TABLE: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "inch": 0.0254, "ft": 0.3048},
    "acceleration": {
        "m/s^2": 1.0, "m/s2": 1.0, "m/s/s": 1.0, "ms^-2": 1.0, "ms-2": 1.0, "mm/s^2": 1e-3, "mm/s2": 1e-3,
        "g": STANDARD_GRAVITY, "g0": STANDARD_GRAVITY, "gn": STANDARD_GRAVITY,
        "mg": 1e-3 * STANDARD_GRAVITY, "gal": 1e-2,
    },
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180, "degree": pi / 180, "degrees": pi / 180,
              "grad": pi / 180, "rev": 2 * pi, "turn": 2 * pi},
    "angular velocity": {"rad/s": 1.0, "mrad/s": 1e-3, "deg/s": pi / 180, "degrees/s": pi / 180,
                         "grad/s": pi / 180,
                         "rpm": pi / 30, "rev/min": pi / 30, "1/min": pi / 30, "rev/s": 2 * pi},
    "velocity": {"m/s": 1.0, "mm/s": 1e-3, "cm/s": 1e-2, "km/h": 1 / 3.6, "kph": 1 / 3.6, "mph": 0.44704,
                 "in/s": 0.0254, "ft/s": 0.3048},
    "angular acceleration": {"rad/s^2": 1.0, "rad/s2": 1.0, "deg/s^2": pi / 180, "deg/s2": pi / 180,
                             "grad/s^2": pi / 180, "grad/s2": pi / 180},
    "force": {"N": 1.0, "kN": 1e3, "mN": 1e-3, "daN": 10.0, "kgf": STANDARD_GRAVITY, "lbf": 4.4482216152605},
    "torque": {"Nm": 1.0, "kNm": 1e3, "mNm": 1e-3, "Nmm": 1e-3, "Ncm": 1e-2, "lbfft": 1.3558179483314,
               "lbfin": 0.1129848290276},
    "pressure": {"Pa": 1.0, "hPa": 1e2, "kPa": 1e3, "MPa": 1e6, "bar": 1e5, "mbar": 1e2, "psi": 6894.757293168},
    "mass": {"kg": 1.0, "gram": 1e-3, "lb": 0.45359237},
    "current": {"A": 1.0, "amp": 1.0, "ampere": 1.0, "mA": 1e-3},
    "voltage": {"V": 1.0, "mV": 1e-3, "kV": 1e3, "volt": 1.0},
    "power": {"W": 1.0, "kW": 1e3, "mW": 1e-3, "hp": 745.69987158227},
    "frequency": {"Hz": 1.0, "kHz": 1e3},
}  # fmt: skip

UNITS: Mapping[str, Unit] = MappingProxyType(
    {name: Unit(factor, dimension) for dimension, row in _TABLE.items() for name, factor in row.items()}
)
"""Every unit that is understood, by its normalised spelling."""

_SPELLINGS = (
    ("²", "^2"), ("**", "^"), ("⁻¹", "^-1"), ("⁻", "^-"), ("µ", "u"), ("μ", "u"), ("°", "deg"), ("º", "deg"),
    ("·", ""), ("*", ""), ("(", ""), (")", ""), (" ", ""),
)  # fmt: skip


def find_unit(text: str) -> Unit | None:
    """The unit written as ``text``, or None if the table does not have it.

    The spelling is tried as it stands, then in lower case (``MM``, ``Deg``, ``RPM``).
    """
    for written, plain in _SPELLINGS:
        text = text.replace(written, plain)
    return UNITS.get(text) or UNITS.get(text.lower())


def usual_units(dimension: str) -> tuple[str, ...]:
    """The units of the table that measure a ``dimension``."""
    return tuple(_TABLE[dimension])


_LONGEST = 40
_WRITTEN = re.compile(r"[A-Za-z%][A-Za-z0-9_%^*/(). -]*")
_NUMBERED = re.compile(r"\d{3}|[^A-Za-z^0-9-]-?\d+\s*\^|\d\s*\^|\)\s*\^")
"""What no unit needs: numbers of three digits, and powers of anything but a name."""


_NO_UNIT = (
    ArithmeticError, AssertionError, AttributeError, LookupError, SyntaxError, TokenError, TypeError, ValueError,
)  # fmt: skip
"""What Pint's parser and its arithmetic raise besides Pint's own errors, at a text that is no unit."""


def factor_between(text: str, si: str) -> float | None:
    """How many of the unit ``si`` one of the unit ``text`` is, by Pint.

    None where it knows either not, where they measure different things, and where one counts from elsewhere, as
    degrees Celsius do against kelvin.
    """
    # Only here: Pint takes a second to load.
    from pint.errors import PintError

    unit, nothing, wanted = _quantity(1.0, text), _quantity(0.0, text), _quantity(1.0, si)
    if unit is None or nothing is None or wanted is None:
        return None
    try:
        found, begin = (float(each.to(wanted.units).magnitude) for each in (unit, nothing))
    except (PintError, *_NO_UNIT):
        return None
    return found if begin == 0.0 and isfinite(found) and found > 0.0 else None


def is_unit(text: str) -> bool:
    """Whether a text is a unit that the table has or Pint knows; degrees Celsius are one, too."""
    return find_unit(text) is not None or _quantity(1.0, text) is not None


def _quantity(value: float, text: str) -> "pint.Quantity[float] | None":
    """So many of the unit ``text``; None where Pint does not know it."""
    from pint.errors import PintError

    plain = _plain(text)
    if len(plain) > _LONGEST or not _WRITTEN.fullmatch(plain) or _NUMBERED.search(plain):
        return None
    try:
        return _registry().Quantity(value, plain)
    except (PintError, *_NO_UNIT):
        return None


def _plain(text: str) -> str:
    for written, plain in (("²", "^2"), ("³", "^3"), ("**", "^"), ("µ", "u"), ("μ", "u"), ("·", "*")):
        text = text.replace(written, plain)
    return text.strip()


@cache
def _registry() -> "pint.UnitRegistry[float]":
    import pint

    return pint.UnitRegistry()
