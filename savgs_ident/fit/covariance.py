"""Covariance of estimates from the Jacobian of a fit, with directions that the data do not tell.

A direction of the free coordinates along which the residuals do not change has no covariance. It is given
a large one instead of a wrong one: the inverse information is capped at :data:`UNTOLD`, so that correlations
stay meaningful and a standard error shows that there is none.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

UNTOLD = 1e3
"""Standard deviation given to an untold direction [1]: a thousand e-folds of an identified parameter."""


class Spread(NamedTuple):
    """Covariance (n, n) of the unconstrained coordinates [1]."""

    covariance: NDArray[np.float64]

    @property
    def sd(self) -> NDArray[np.float64]:
        """Standard deviations, (n,)."""
        return np.sqrt(np.diag(self.covariance))


def spread_of(jacobian: NDArray[np.float64]) -> Spread:
    """The spread for residuals of unit variance with ``jacobian`` (m, n), priors among the rows."""
    # Fewer residuals than coordinates leave directions untold; the thin decomposition would drop them.
    missing = max(0, jacobian.shape[1] - jacobian.shape[0])
    _, singular, axes = np.linalg.svd(np.pad(jacobian, ((0, missing), (0, 0))), full_matrices=False)
    sd = 1.0 / np.maximum(singular, 1.0 / UNTOLD)
    return Spread((axes.T * sd**2) @ axes)
