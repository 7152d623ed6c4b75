"""Units that laboratories write into headers, and their factor to SI.

A unit belongs to a dimension, a channel wants one dimension: a deflection in seconds is an error.

>>> unit_factor("mm", "susp_deflection")
0.001
>>> unit_factor("m/s²", "sprung_accel")
1.0
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from types import MappingProxyType

from savgs_ident.core.errors import InputError

STANDARD_GRAVITY = 9.80665
"""Standard acceleration of free fall [m/s^2] (ISO 80000-3)."""


@dataclass(frozen=True)
class Unit:
    """``factor`` turns a number in this unit into SI; ``dimension`` says what it measures."""

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
              "rev": 2 * pi, "turn": 2 * pi},
    "angular velocity": {"rad/s": 1.0, "mrad/s": 1e-3, "deg/s": pi / 180, "degrees/s": pi / 180,
                         "rpm": pi / 30, "rev/min": pi / 30, "1/min": pi / 30, "rev/s": 2 * pi},
    "current": {"A": 1.0, "amp": 1.0, "ampere": 1.0, "mA": 1e-3},
}  # fmt: skip

UNITS: Mapping[str, Unit] = MappingProxyType(
    {name: Unit(factor, dimension) for dimension, row in _TABLE.items() for name, factor in row.items()}
)
"""Every unit that is understood, by its normalised spelling."""

DIMENSIONS: Mapping[str, str] = MappingProxyType(
    {
        "time": "time",
        "road_height": "length",
        "sprung_accel": "acceleration",
        "susp_deflection": "length",
        "link_angle": "angle",
        "link_velocity": "angular velocity",
        "motor_current": "current",
    }
)
"""What each canonical channel measures."""

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


def unit_factor(text: str, channel: str, *, source: object = "") -> float:
    """The factor from the unit ``text`` to the SI unit of the canonical ``channel``.

    Raises :class:`InputError` for a unit that is not in the table or measures something else.
    """
    dimension = DIMENSIONS[channel]
    usual = ", ".join(_TABLE[dimension])
    unit = find_unit(text)
    if unit is None:
        raise InputError(
            f"unknown unit '{text}'",
            source=source,
            channel=channel,
            remedy=f"write one of {usual}, or give unit and scale in channels.toml",
        )
    if unit.dimension != dimension:
        raise InputError(
            f"unit '{text}' is {_with_article(unit.dimension)}, the channel is {_with_article(dimension)}",
            source=source,
            channel=channel,
            remedy=f"write one of {usual}, or map the right signal in channels.toml",
        )
    return unit.factor


def _with_article(dimension: str) -> str:
    return f"{'an' if dimension[0] in 'a' else 'a'} {dimension}"
