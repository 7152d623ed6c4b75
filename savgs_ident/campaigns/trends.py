"""Estimates of one parameter from many campaigns: whether they agree, and whether they change with time.

Each campaign k gives an estimate y_k with its standard error s_k at x_k (a time, or a number in order). All of them
give their weighted mean, with the chi2 of the estimates about it, and the line

    y = value + slope (x - centre),   centre the weighted mean of x, so that value and slope are uncorrelated

    line = follow(x, y, s).line
    low, high = line.slope_interval

Where the estimates scatter more than their errors say (the chi2 about the mean, or about the line, is exceeded by
chance in less than 5 % of cases), something else differs from campaign to campaign. The errors are then widened to
the scatter, by sqrt(chi2/dof), and since that is known from these few estimates only, intervals are Student's. The
line is compared with the scatter about the line: the chi2 about the mean would count the trend itself as scatter.

The errors s_k are those that differ from campaign to campaign: noise and drift. What all campaigns of a rig have in
common, what its sheet gives wrong and the small errors of its model, moves all estimates alike. Campaigns are
compared by the first alone (``own_stderr`` of a fit's estimates). The second is in the error of the mean in full,
however many campaigns there are, and in no slope and no scatter.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import chi2 as chi2_distribution
from scipy.stats import norm, t

from savgs_ident.core.errors import InputError

CONFIDENCE = 0.95
"""Probability of the intervals."""

_UPPER = 0.5 * (1.0 + CONFIDENCE)
_NORMAL = float(norm.ppf(_UPPER))

UNLIKELY = 0.05
"""Estimates scatter more than their errors if chance exceeds their chi2 with a smaller probability."""


@dataclass(frozen=True)
class Scatter:
    """How estimates lie about what they should be.

    Attributes:
        chi2: sum of the squared deviations in standard errors.
        dof: estimates less what was adjusted to them.
        probability: with which chance alone exceeds chi2; 1 where dof is 0.
    """

    chi2: float
    dof: int
    probability: float

    @property
    def beyond_errors(self) -> bool:
        """Whether they scatter more than their errors say."""
        return self.probability < UNLIKELY

    @property
    def widening(self) -> float:
        """By what the errors are to be multiplied [1], 1 where the estimates lie within them."""
        return float(np.sqrt(self.chi2 / self.dof)) if self.beyond_errors else 1.0

    @property
    def quantile(self) -> float:
        """Half the width of an interval of :data:`CONFIDENCE` in (widened) standard errors."""
        return float(t.ppf(_UPPER, self.dof)) if self.beyond_errors else _NORMAL


@dataclass(frozen=True)
class Mean:
    """The weighted mean; all in the unit of the estimates.

    Attributes:
        value: of the mean.
        own_stderr: its standard error from what differs between campaigns, widened where ``scatter`` asks for it.
        common_stderr: that from what all have in common.
        scatter: of the estimates about it.
    """

    value: float
    own_stderr: float
    common_stderr: float
    scatter: Scatter

    @property
    def stderr(self) -> float:
        """Its whole standard error."""
        return float(np.hypot(self.own_stderr, self.common_stderr))

    @property
    def interval(self) -> tuple[float, float]:
        """Its ends with :data:`CONFIDENCE`. In the unit of the estimates."""
        half = float(np.hypot(self.scatter.quantile * self.own_stderr, _NORMAL * self.common_stderr))
        return self.value - half, self.value + half


@dataclass(frozen=True)
class Line:
    """A weighted straight line; standard errors widened where its ``scatter`` asks for it.

    Attributes:
        centre: where ``value`` is taken [unit of x].
        value: of the line there, with its ``value_stderr``.
        slope: change per unit of x, with its ``slope_stderr``; uncorrelated with ``value``.
        scatter: of the estimates about the line.
    """

    centre: float
    value: float
    value_stderr: float
    slope: float
    slope_stderr: float
    scatter: Scatter

    @property
    def slope_interval(self) -> tuple[float, float]:
        """The ends of the slope's interval with :data:`CONFIDENCE`.

        In the unit of the estimates per unit of x.
        """
        half = self.scatter.quantile * self.slope_stderr
        return self.slope - half, self.slope + half

    @property
    def rises_or_falls(self) -> bool:
        """Whether the slope's interval leaves out zero."""
        low, high = self.slope_interval
        return low > 0.0 or high < 0.0

    def at(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """The line at ``x`` (n,), and half the width of its band: (2, n).

        In the unit of the estimates; x in its own.
        """
        away = x - self.centre
        half = self.scatter.quantile * np.hypot(self.value_stderr, away * self.slope_stderr)
        return np.stack([self.value + self.slope * away, half])


@dataclass(frozen=True)
class Trend:
    """What estimates of one parameter say together; no ``line`` where all are at the same x."""

    mean: Mean
    line: Line | None


def follow(x: ArrayLike, y: ArrayLike, stderr: ArrayLike, common: float = 0.0) -> Trend:
    """Mean and line of estimates ``y`` with standard errors ``stderr`` of their own at ``x``, each (n,).

    ``common`` is the standard error that they have in common.

    Raises :class:`InputError` for no estimates, values that are not finite, and errors that are not positive.
    """
    at, values, errors = (np.asarray(each, dtype=np.float64) for each in (x, y, stderr))
    if not (at.shape == values.shape == errors.shape and at.ndim == 1 and at.size):
        raise InputError("a trend needs estimates with their errors and places, as many of each")
    if not np.isfinite([at, values, errors]).all() or np.any(errors <= 0.0):
        raise InputError("a trend needs finite estimates with positive errors")
    # Weights relative to the largest: squares of tiny errors would overflow.
    weights = (errors.min() / errors) ** 2
    return Trend(_mean(values, errors, weights, common), _line(at, values, errors, weights))


def _mean(
    y: NDArray[np.float64], errors: NDArray[np.float64], weights: NDArray[np.float64], common: float
) -> Mean:
    value = float(np.average(y, weights=weights))
    scatter = _scatter((y - value) / errors, 1)
    own = scatter.widening * float(errors.min() / np.sqrt(weights.sum()))
    return Mean(value, own, common, scatter)


def _line(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    errors: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> Line | None:
    if np.ptp(x) == 0.0:
        return None
    centre, value = (float(np.average(each, weights=weights)) for each in (x, y))
    away = x - centre
    spread = float(np.sum(weights * away**2))
    slope = float(np.sum(weights * away * (y - value))) / spread
    scatter = _scatter((y - value - slope * away) / errors, 2)
    unit = scatter.widening * float(errors.min())
    return Line(centre, value, unit / np.sqrt(weights.sum()), slope, unit / np.sqrt(spread), scatter)


def _scatter(deviations: NDArray[np.float64], adjusted: int) -> Scatter:
    """Of deviations (n,) [standard errors] that are left after so many numbers were adjusted."""
    dof = max(deviations.size - adjusted, 0)
    total = float(np.sum(deviations**2))
    return Scatter(total, dof, float(chi2_distribution.sf(total, dof)) if dof else 1.0)
