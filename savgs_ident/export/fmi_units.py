"""Units as FMI defines them: exponents of the SI's base units.

>>> base_units("N s/m")
{'kg': 1, 's': -1}
"""

import re
from collections import Counter
from collections.abc import Mapping
from types import MappingProxyType

BASE = ("kg", "m", "s", "A", "rad")
"""Base units of FMI that a rig uses."""

_DERIVED: Mapping[str, Mapping[str, int]] = MappingProxyType(
    {
        "N": {"kg": 1, "m": 1, "s": -2},
        "Pa": {"kg": 1, "m": -1, "s": -2},
        "J": {"kg": 1, "m": 2, "s": -2},
        "W": {"kg": 1, "m": 2, "s": -3},
        "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
        "ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
        "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
        "Wb": {"kg": 1, "m": 2, "s": -2, "A": -1},
        "Hz": {"s": -1},
    }
)

_PART = re.compile(r"([A-Za-z]+)(?:\^(\d+))?")


def base_units(unit: str) -> dict[str, int]:
    """Exponents of the base units in a unit of a rig file; empty for "1". An unknown unit is a KeyError."""
    total: Counter[str] = Counter()
    above, _, below = unit.partition("/")
    for side, sign in ((above, 1), (below, -1)):
        for symbol, power in _PART.findall(side):
            parts = {symbol: 1} if symbol in BASE else _DERIVED[symbol]
            for base, exponent in parts.items():
                total[base] += sign * exponent * int(power or 1)
    return {base: total[base] for base in BASE if total[base]}
