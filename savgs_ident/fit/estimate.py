"""Estimated parameters: values with errors, and whether one can be believed beside its sheet and its bounds."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import isfinite

import numpy as np

from savgs_ident.core.parameter import Parameter

FAR_OFF = 5.0
"""Standard deviations from its sheet at which a number is not believed: by chance it is there once in two million."""

_THOUSAND = 1000.0
_UNITS_TAKEN = (
    (9.80665, "g was taken for m/s^2, or the other way round"),
    (_THOUSAND, "a unit was taken for another one a thousand times as large"),
    (180.0 / np.pi, "degrees were taken for radians"),
    (25.4, "inches were taken for millimetres"),
    (0.0254, "inches were taken for metres"),
    (100.0, "a unit was taken for another one a hundred times as large"),
)
_NEARLY = 0.08
"""Difference in the logarithm up to which a ratio is that of two units: about what parts and sensors differ by."""


@dataclass(frozen=True)
class Estimate:
    """One estimated parameter in SI.

    ``stderr`` is its standard error, which contains what the model leaves unexplained; ``own_stderr`` is the part of
    it that another campaign of the same rig does not share: noise and drift. ``free`` distinguishes an identified
    parameter from one that was known to a tolerance and estimated along. For the latter ``prior`` and ``prior_sd``
    say what was known before; ``prior_sd`` is zero of a number of which the order of magnitude was known alone.
    """

    name: str
    value: float
    stderr: float
    own_stderr: float
    unit: str
    free: bool
    prior: float
    prior_sd: float

    @property
    def tolerances_off(self) -> float:
        """By how many of its tolerances it is off its sheet [1]; 0 for what has none."""
        return abs(self.value - self.prior) / self.prior_sd if self.prior_sd > 0.0 else 0.0

    @property
    def unit_taken(self) -> str:
        """Which unit was taken for which, where the value is off its sheet by as much; empty where it is not.

        A gain shows the unit of what it multiplies. Of any other number a thousandth is a slip of the sheet's.
        """
        ratio = self.value / self.prior if self.prior else 0.0
        if ratio <= 0.0:
            return ""
        found = (
            words
            for factor, words in _UNITS_TAKEN
            if (self.unit == "1" or factor == _THOUSAND)
            and abs(abs(np.log(ratio)) - abs(np.log(factor))) < _NEARLY
        )
        return next(found, "")


def far_off_sentence(each: Estimate) -> str:
    """Why a value that is far off its sheet is not to be believed, and what it may come from."""
    cause = (
        each.unit_taken
        or "look at the units and signs of the channels and at the sheet, or for what is missing"
    )
    start = "as if " if each.unit_taken else ""
    return (
        f"{each.name} would have to be {each.value:.4g} {each.unit} where the sheet has {each.prior:.4g}, "
        f"{each.tolerances_off:.0f} tolerances off: {start}{cause}"
    )


AT_A_BOUND = 0.01
"""By which share of a bound a value is off that is at it: a search comes near to a bound and does not reach it."""


def at_bounds(parameters: Iterable[Parameter], values: Mapping[str, float]) -> dict[str, str]:
    """Which ``values`` [SI] ended at a bound of their parameters, in words by name; a bound of zero is left out."""
    ends = ((each, ("lower", each.lower), ("upper", each.upper)) for each in parameters)
    return {
        each.name: f"{each.name} ended at its {side} bound, {with_unit(bound, each.unit)}: it would go further, or "
        "makes up for something."
        for each, *both in ends
        for side, bound in both
        if bound and isfinite(bound) and abs(values[each.name] - bound) <= AT_A_BOUND * abs(bound)
    }


def with_unit(value: float, unit: str) -> str:
    """A value and its unit, as text."""
    return f"{value:.3g}" if unit == "1" else f"{value:.3g} {unit}"
