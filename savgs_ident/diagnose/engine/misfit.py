"""How far rows miss: the noise's own scale, and a discrepancy of the model beside it.

Row i is normal about the model with variance s^2 v_i + (d a_i)^2, where v_i is its noise, a_i what a relative
discrepancy of one would do to it, s the noise scale and d the discrepancy. Both are set to their best values
under their priors (s log-normal about 1, d half-normal), so that a model that misses is weighed by what it can
explain.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnose.engine.data import Data

NOISE_TRUST = 0.1
"""Standard deviation of the logarithm of the noise scale."""

DISCREPANCY = 0.05
"""Scale of the half-normal prior of the discrepancy."""

_ROUNDS = 60
_LONGEST = 1.5
_LEVEL = 1e-6
_LEAST = 1e-7


class Misfit(NamedTuple):
    """Noise scale, discrepancy, the variance of the rows (m,) that they make, and the log density with them."""

    noise: float
    discrepancy: float
    spread: NDArray[np.float64]
    value: float


def misfit_of(data: Data, residual: NDArray[np.float64], start: float = 1e-2) -> Misfit:
    """The best noise scale and discrepancy for residuals (m,), and the log density of the residuals.

    The density is that of the rows in units of their noise, the priors of both scales included. Fisher's scoring
    on the logarithms of both, the discrepancy from ``start`` on.
    """
    square, noise, reach = residual**2, data.variance, data.reach**2
    logs = np.array([0.0, np.log(max(start, 1e-4))])
    for _ in range(_ROUNDS):
        shares = np.stack([np.exp(2.0 * logs[0]) * noise, np.exp(2.0 * logs[1]) * reach])
        spread = shares.sum(axis=0)
        shares /= spread
        relative = (np.exp(logs[1]) / DISCREPANCY) ** 2
        gradient = shares @ (square / spread - 1.0) - np.array([logs[0] / NOISE_TRUST**2, relative])
        curvature = 2.0 * shares @ shares.T + np.diag([1.0 / NOISE_TRUST**2, 2.0 * relative + 1e-3])
        step = np.linalg.solve(curvature, gradient)
        step /= max(1.0, float(np.max(np.abs(step))) / _LONGEST)
        logs = np.maximum(logs + step, [-1.0, np.log(_LEAST)])
        if np.max(np.abs(step)) < _LEVEL or (abs(step[0]) < _LEVEL and logs[1] < np.log(1e-5)):
            break
    scale, miss = np.exp(logs)
    spread = scale**2 * noise + miss**2 * reach
    return Misfit(float(scale), float(miss), spread, _density(square, noise, spread, logs[0], miss))


def _density(
    square: NDArray[np.float64],
    noise: NDArray[np.float64],
    spread: NDArray[np.float64],
    log_scale: float,
    miss: float,
) -> float:
    rows = -0.5 * np.sum(square / spread + np.log(spread / noise))
    return float(rows - 0.5 * (log_scale / NOISE_TRUST) ** 2 - 0.5 * (miss / DISCREPANCY) ** 2)
