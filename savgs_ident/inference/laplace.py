"""Laplace's method: a normal density in place of a posterior, and the best point of a linearised hypothesis.

With rows of slope J (m, n) and variance s (m,) in coordinates x whose prior is the unit normal, the posterior about
its mode has the precision

    P = I + J' diag(1/s) J

and the log evidence of the hypothesis, up to what all hypotheses share, is

    log Z = value - log det(P) / 2 + h log 2

with the log density ``value`` at the mode and h the number of coordinates whose prior is cut in half there. Where no
unit normal stands beside the rows, priors are rows themselves (:func:`spread_of`), and a direction along which
nothing changes has no covariance: its standard deviation is :data:`LARGEST_SPREAD`, so that correlations stay
meaningful.

The best point of a linearised hypothesis (:func:`linearised_optimum`), rows r + J d with a unit-normal prior on x + d
and bounds on it, depends on the rows' variance, noise scale and discrepancy included, and these on how far the rows
miss there (:func:`savgs_ident.inference.likelihood.noise_scales`): the two are found in turn. Errors for the best
discrepancy alone are too small where that is zero and a larger one nearly as probable; those over all of them
(:func:`covariance_over_discrepancies`) are not.
"""

from math import log
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.inference.likelihood import (
    NoiseScales,
    noise_scales,
    noise_scales_near,
    with_more_discrepancy,
)
from savgs_ident.inference.observations import Data
from savgs_ident.inference.prior import Coordinates

Array = NDArray[np.float64]

LARGEST_SPREAD = 1e3
"""Standard deviation of a direction that is not identified [1]: a thousand e-folds of an identified parameter."""


def precision_of(slopes: Array, variance: Array) -> Array:
    """Precision P [1], (n, n), of coordinates with unit-normal priors.

    ``slopes`` (m, n) are those of the rows [unit of the row], ``variance`` (m,) theirs [its square].
    """
    return np.asarray(np.eye(slopes.shape[1]) + (slopes.T / variance) @ slopes)


def log_determinant(precision: Array) -> float:
    """log det [1] of a precision matrix (n, n). Raises :class:`numpy.linalg.LinAlgError` if it is none."""
    return float(2.0 * np.sum(np.log(np.diag(np.linalg.cholesky(precision)))))


def log_evidence(value: float, precision: Array, coordinates: Coordinates) -> float:
    """log Z for the log density ``value`` [1] at the mode, with its ``precision`` [1], (n, n).

    ``coordinates`` are those that may have half a prior; others in the precision, as a law's coefficients, have a
    whole one.
    """
    return value - 0.5 * log_determinant(precision) + log(2.0) * sum(each.halved for each in coordinates)


def attainable_evidence(
    value: float, x: Array, precision: Array, coordinates: Coordinates, free: NDArray[np.bool_]
) -> float:
    """The log evidence that no choice among some coordinates can exceed: as if those that are ``free`` cost nothing.

    ``value`` is the log density [1] at the mode ``x`` [1], (n,), with its ``precision``, (n, n); ``free`` is (n,).
    Without some of them nothing fits better, and what is kept narrows its prior. With none it is the log evidence.
    """
    kept = tuple(each for each, spared in zip(coordinates, free, strict=True) if not spared)
    return log_evidence(value + 0.5 * float(x[free] @ x[free]), precision[np.ix_(~free, ~free)], kept)


HOPE = 10.0
"""How many times what its next step promises a search may still rise [1]; with less to go for it is given up."""


def is_hopeless(value: float, promised: float, least: float) -> bool:
    """Whether a search at a log evidence of ``value`` that rises by ``promised`` to first order misses ``least``."""
    return value + HOPE * promised < least


class Spread(NamedTuple):
    """Covariance (n, n) of unconstrained coordinates [1]."""

    covariance: Array

    @property
    def sd(self) -> Array:
        """Standard deviations, (n,)."""
        return np.sqrt(np.diag(self.covariance))


def principal_axes(jacobian: Array, longest: float) -> Array:
    """Columns along the principal axes of the covariance for rows of unit variance, one sd long each, or shorter.

    ``jacobian`` (m, n) has the priors among its rows; no column is longer than ``longest`` [1]. The shortest comes
    first. The covariance is ``axes @ axes.T``. A Jacobian that is not finite, of a model that could not be evaluated,
    says nothing: all columns are the longest.
    """
    if not np.all(np.isfinite(jacobian)):
        return longest * np.eye(jacobian.shape[1])
    # Fewer rows than coordinates leave directions without any; the thin decomposition would drop them.
    missing = max(0, jacobian.shape[1] - jacobian.shape[0])
    _, sizes, axes = np.linalg.svd(np.pad(jacobian, ((0, missing), (0, 0))), full_matrices=False)
    return np.asarray(axes.T / np.maximum(sizes, 1.0 / longest))


def spread_of(jacobian: Array) -> Spread:
    """The spread for residuals of unit variance with ``jacobian`` (m, n), priors among the rows."""
    axes = principal_axes(jacobian, LARGEST_SPREAD)
    return Spread(axes @ axes.T)


_DISCREPANCIES = np.concatenate([[0.0], np.geomspace(1e-5, 30.0, 120)])
"""Discrepancies over which errors are averaged [scales of the prior]."""


def covariance_over_discrepancies(
    data: Data, residual: Array, slopes: Array, x: Array, scales: NoiseScales
) -> Array:
    """Covariance (n, n) of coordinates about ``x`` (n,) [1], whatever the discrepancy is that the data allow.

    For residuals (measured - predicted, m) with slopes (m, n) of the prediction at ``x``, the best point for the
    noise scale and the discrepancy of ``scales``; ``data`` are independent rows, in their units. Each discrepancy has
    a best point and a covariance of its own. As probable as it is by rows and prior together, it counts with both.
    What a bound keeps from moving at the best point is kept there from as much.
    """

    def normal(spread: Array) -> tuple[Array, Array]:
        precision = precision_of(slopes, spread)
        step = np.linalg.solve(precision, (slopes.T / spread) @ residual - x)
        return np.asarray(step), precision

    kept, _ = normal(scales.spread)
    value, moments = [], []
    for size in _DISCREPANCIES:
        miss = size * data.scales.discrepancy * data.discrepancy_scale
        spread = scales.noise**2 * data.variance + miss**2
        top, precision = normal(spread)
        moved = top - kept
        left, there = residual - slopes @ moved, x + moved
        density = float(np.sum(left**2 / spread + np.log(spread)) + there @ there) + size**2
        value.append(-0.5 * (density + log_determinant(precision)))
        moments.append(np.linalg.inv(precision) + np.outer(moved, moved))
    weight = np.exp(np.array(value) - max(value)) * np.gradient(_DISCREPANCIES)
    return np.asarray(np.tensordot(weight / weight.sum(), np.stack(moments), axes=1))


_LINEAR_ROUNDS = 50
_PASSES = 60


class LinearisedOptimum(NamedTuple):
    """The best point of a linearised hypothesis.

    Attributes:
        x: its coordinates [1], (n,).
        noise_scales: noise scale and discrepancy for the residuals that are predicted there.
        value: log density of rows and prior, up to what all hypotheses share.
        precision: precision of the coordinates there [1], (n, n).
        converged: whether point and scales fit each other.
    """

    x: Array
    noise_scales: NoiseScales
    value: float
    precision: Array
    converged: bool


def linearised_optimum(
    data: Data,
    residual: Array,
    slopes: Array,
    x: Array,
    bounds: tuple[Array, Array],
    level: float = 1e-3,
    scales: NoiseScales | None = None,
) -> LinearisedOptimum:
    """The best point for residuals (measured - predicted, m) with slopes (m, n) of the prediction at ``x`` (n,).

    ``data`` are independent rows, in their units; coordinates are in standard deviations. The point for given
    weights and the scales for a given point in turn, until the density rises by less than ``level``: it rises at
    every turn. They begin with ``scales``, if these are known for the residuals.
    """
    scales = scales or noise_scales(data, residual)
    value, point, converged = -np.inf, x, False
    for _ in range(_LINEAR_ROUNDS):
        point, inside = _within(residual, slopes, x, scales.spread, bounds)
        left, before = residual - slopes @ (point - x), value
        scales = noise_scales_near(data, left, scales)
        value = scales.value - 0.5 * float(point @ point)
        if abs(value - before) < level:
            scales, known = with_more_discrepancy(data, left, scales), scales
            if scales.value < known.value + level:
                converged = scales.converged and inside
                break
    return LinearisedOptimum(point, scales, value, precision_of(slopes, scales.spread), converged)


def _within(
    residual: Array, slopes: Array, x: Array, spread: Array, bounds: tuple[Array, Array]
) -> tuple[Array, bool]:
    """The best point within the bounds for given weights, and whether the search for it ended.

    What would leave the bounds is held there, and let go where the density rises inwards.
    """
    weighted = slopes / spread[:, None]
    precision = np.eye(x.size) + weighted.T @ slopes
    right = weighted.T @ (residual + slopes @ x)
    lower, upper = bounds
    point, free = x.copy(), np.ones(x.size, bool)
    for _ in range(_PASSES):
        point[free] = np.linalg.solve(
            precision[np.ix_(free, free)], right[free] - precision[np.ix_(free, ~free)] @ point[~free]
        )
        out = free & ((point < lower) | (point > upper))
        if out.any():
            point = np.clip(point, lower, upper)
            free &= ~out
            continue
        rise = right - precision @ point
        inwards = ~free & np.where(point <= lower, rise > 0.0, rise < 0.0) & (lower < upper)
        if not inwards.any():
            return point, True
        free[np.argmax(np.where(inwards, np.abs(rise), -np.inf))] = True
    return np.clip(point, lower, upper), False
