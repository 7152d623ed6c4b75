"""How far rows miss: the noise's own scale, and a discrepancy of the model beside it, at their best values.

Row i is normal about the model with variance s^2 v_i + (d a_i)^2, where v_i is its noise, a_i what a relative
discrepancy of one would do to it, s the noise scale and d the discrepancy, under the priors of
:class:`savgs_ident.inference.prior.Scales`. A model that misses is thereby weighed by what it can explain.

The best point of a linearised hypothesis, rows r + J d with a unit-normal prior on x + d and bounds on it, depends on
these weights, and they on how far the rows miss there: the two are found in turn.
"""

from math import exp, isfinite, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.inference.laplace import precision_of
from savgs_ident.inference.observations import Data
from savgs_ident.inference.prior import Scales

_ROUNDS = 60
_HALVINGS = 40
_LONGEST = 1.5
_LEVEL = 1e-9


class NoiseScales(NamedTuple):
    """The best noise scale and discrepancy for given residuals.

    Attributes:
        noise: factor on the standard deviation of the noise [1].
        discrepancy: relative rms by which the model misses beyond the noise [1].
        spread: variance of the rows (m,) that they make [unit of the row squared].
        value: log density of the rows in units of their noise, the priors of both scales included.
        converged: whether the search for them ended at a maximum.
    """

    noise: float
    discrepancy: float
    spread: NDArray[np.float64]
    value: float
    converged: bool


def noise_scales(data: Data, residual: NDArray[np.float64], start: float = 1e-2) -> NoiseScales:
    """The best noise scale and discrepancy for residuals (m,) of independent rows.

    The discrepancy is looked for from ``start`` on.

    There may be two maxima, of which one has little discrepancy: where the residuals have room for more than was
    found, it is looked for from there too.
    """
    found = _maximum_from(data, residual, start)
    excess, discrepancy_scale = (
        float(np.sum(residual**2 - data.variance)),
        float(np.sum(data.discrepancy_scale**2)),
    )
    if excess > 2.0 * max(found.discrepancy, 1e-4) ** 2 * discrepancy_scale > 0.0:
        return max(
            found,
            _maximum_from(data, residual, float(np.sqrt(excess / discrepancy_scale))),
            key=lambda each: each.value,
        )
    return found


def _maximum_from(data: Data, residual: NDArray[np.float64], start: float) -> NoiseScales:
    """The maximum that is reached from a discrepancy.

    Steps in the logarithm of the noise scale and the square of the discrepancy: the better of Newton's, which is
    short where residuals far exceed the noise, and Fisher's, which is long there, halved until the density rises.
    Without that, Fisher's scoring swings to and fro where the noise is understated.
    """
    rows = _Rows(residual**2, data.variance, data.discrepancy_scale**2, data.scales)
    point = (0.0, start**2 if rows.discrepancy_scale.any() else 0.0)
    value, converged = _density(rows, point), False
    for _ in range(_ROUNDS):
        steps, promised = _steps(rows, point)
        if promised < _LEVEL:
            converged = isfinite(value)
            break
        for halving in range(_HALVINGS):
            share = 0.5**halving
            tried = [(point[0] + share * log, max(point[1] + share * square, 0.0)) for log, square in steps]
            found, there = max((_density(rows, each), each) for each in tried)
            if found > value:
                break
        else:
            # What is promised is less than a sum over the rows resolves.
            converged = promised < 1e-6
            break
        point, value = there, found
    scale, miss = exp(point[0]), sqrt(point[1])
    return NoiseScales(
        scale, miss, scale**2 * rows.noise + miss**2 * rows.discrepancy_scale, value, converged
    )


class _Rows(NamedTuple):
    """Squares (m,) of residuals, of the noise's deviations and of what a relative discrepancy of one does; priors."""

    residual: NDArray[np.float64]
    noise: NDArray[np.float64]
    discrepancy_scale: NDArray[np.float64]
    scales: Scales


_Point = tuple[float, float]
"""Logarithm of the noise scale, square of the discrepancy."""


def _steps(rows: _Rows, point: _Point) -> tuple[list[_Point], float]:
    """Newton's step, where the density is concave, and Fisher's; and the rise that they promise at most."""
    trust, width = rows.scales.noise_trust, rows.scales.discrepancy
    noise = exp(2.0 * point[0]) * rows.noise
    spread = noise + point[1] * rows.discrepancy_scale
    # Derivatives of the logarithm of the variance by either coordinate.
    by = np.stack([2.0 * noise / spread, rows.discrepancy_scale / spread])
    relative = rows.residual / spread
    slope = 0.5 * by @ (relative - 1.0)
    gradient = float(slope[0]) - point[0] / trust**2, float(slope[1]) - 0.5 / width**2
    fisher, newton = 0.5 * by @ by.T, (by * (relative - 0.5)) @ by.T
    newton[0, 0] -= 2.0 * slope[0]
    # No discrepancy is the least one: there it is held.
    held = point[1] == 0.0 and gradient[1] <= 0.0
    found, promised = [], 0.0
    for curvature in (newton, fisher):
        own, both, other = (
            float(curvature[0, 0]) + 1.0 / trust**2,
            float(curvature[0, 1]),
            float(curvature[1, 1]),
        )
        determinant = own * other - both**2
        if held and own > 0.0:
            log, square = gradient[0] / own, 0.0
        elif own > 0.0 and determinant > 1e-12 * own * abs(other):
            log = (other * gradient[0] - both * gradient[1]) / determinant
            square = (own * gradient[1] - both * gradient[0]) / determinant
        else:
            continue
        promised = max(promised, 0.5 * (gradient[0] * log + gradient[1] * square))
        short = min(1.0, _LONGEST / max(abs(log), _LONGEST))
        found.append((short * log, short * square))
    return found, promised


def _density(rows: _Rows, point: _Point) -> float:
    spread = exp(2.0 * point[0]) * rows.noise + point[1] * rows.discrepancy_scale
    data = -0.5 * float(np.sum(rows.residual / spread + np.log(spread / rows.noise)))
    return (
        data - 0.5 * (point[0] / rows.scales.noise_trust) ** 2 - 0.5 * point[1] / rows.scales.discrepancy**2
    )


Vector = NDArray[np.float64]

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

    x: Vector
    noise_scales: NoiseScales
    value: float
    precision: Vector
    converged: bool


def linearised_optimum(
    data: Data,
    residual: Vector,
    slopes: Vector,
    x: Vector,
    bounds: tuple[Vector, Vector],
    level: float = 1e-3,
) -> LinearisedOptimum:
    """The best point for residuals (measured - predicted, m) with slopes (m, n) of the prediction at ``x`` (n,).

    ``data`` are independent rows, in their units; coordinates are in standard deviations. The point for given
    weights and the scales for a given point in turn, until the density rises by less than ``level``: it rises at
    every turn.
    """
    misfit = noise_scales(data, residual)
    value, point, converged = -np.inf, x, False
    for _ in range(_LINEAR_ROUNDS):
        point, inside = _within(residual, slopes, x, misfit.spread, bounds)
        misfit = noise_scales(data, residual - slopes @ (point - x), misfit.discrepancy)
        before, value = value, misfit.value - 0.5 * float(point @ point)
        if abs(value - before) < level:
            converged = misfit.converged and inside
            break
    return LinearisedOptimum(point, misfit, value, precision_of(slopes, misfit.spread), converged)


def _within(
    residual: Vector, slopes: Vector, x: Vector, spread: Vector, bounds: tuple[Vector, Vector]
) -> tuple[Vector, bool]:
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
