"""The best point of a linearised hypothesis, noise scale and discrepancy included.

Rows r + J d with a unit-normal prior on x + d and bounds on it: the weights of the rows depend on how far they
miss at the best point, which depends on the weights. The two are found in turn.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnose.engine.data import Data
from savgs_ident.diagnose.engine.misfit import Misfit, misfit_of

Vector = NDArray[np.float64]

_ROUNDS = 12
_LEVEL = 1e-3
_PASSES = 6


class Top(NamedTuple):
    """The best point: coordinates (n,), predicted misfit, log density with prior, precision (n, n) there.

    ``value`` is the log density of rows and prior, up to what all hypotheses share.
    """

    x: Vector
    misfit: Misfit
    value: float
    precision: Vector


def best_of(
    data: Data,
    residual: Vector,
    slopes: Vector,
    x: Vector,
    bounds: tuple[Vector, Vector],
    kept: NDArray[np.bool_] | None = None,
) -> Top:
    """The best point for residuals (measured - predicted, m) with slopes (m, n) of the prediction at ``x`` (n,).

    Only the rows ``kept`` (m,) count, all by default. Rows are in their units, coordinates in standard
    deviations.
    """
    rows = np.ones(residual.size, bool) if kept is None else kept
    part = Data(data.measured[rows], data.variance[rows], data.reach[rows], data.test[rows])
    here, across = residual[rows], slopes[rows]
    misfit = misfit_of(part, here)
    value, point = -np.inf, x
    for _ in range(_ROUNDS):
        found = _held(here, across, x, misfit.spread, bounds)
        misfit = misfit_of(part, here - across @ (found - x), misfit.discrepancy)
        now = misfit.value - 0.5 * float(found @ found)
        settled = abs(now - value) < _LEVEL
        value, point = now, found
        if settled:
            break
    precision = np.eye(x.size) + (across.T / misfit.spread) @ across
    return Top(point, misfit, value, precision)


def _held(
    residual: Vector, slopes: Vector, x: Vector, spread: Vector, bounds: tuple[Vector, Vector]
) -> Vector:
    """The weighted best point within the bounds; what would leave them is held there, and let go if it may."""
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
        if not out.any():
            break
        point = np.clip(point, lower, upper)
        free &= ~out
    return np.clip(point, lower, upper)


def log_determinant(precision: Vector) -> float:
    """log det [1] of a precision matrix (n, n). Raises :class:`numpy.linalg.LinAlgError` if it is none."""
    return float(2.0 * np.sum(np.log(np.diag(np.linalg.cholesky(precision)))))
