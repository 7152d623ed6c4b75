"""Laplace's method: a normal density in place of a posterior, its covariance and its evidence.

With rows of slope J (m, n) and variance s (m,) in coordinates x whose prior is the unit normal, the posterior about
its mode has the precision

    P = I + J' diag(1/s) J

and the log evidence of the hypothesis, up to what all hypotheses share, is

    log Z = value - log det(P) / 2 + h log 2

with the log density ``value`` at the mode and h the number of coordinates whose prior is cut in half there.

Where no unit normal stands beside the rows, priors are rows themselves (:func:`spread_of`), and a direction along
which nothing changes has no covariance: it is given the standard deviation ``longest`` instead, so that correlations
stay meaningful.
"""

from math import log
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
