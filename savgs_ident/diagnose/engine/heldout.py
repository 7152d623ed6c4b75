"""Predictions of tests that a hypothesis has not seen: each is left out once, the others set the parameters."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnose.engine.climb import Mode, Search, climb
from savgs_ident.diagnose.engine.misfit import misfit_of
from savgs_ident.diagnose.engine.prediction import Term

FOLDS = 3
"""Parts into which the tests are split."""

STEPS = 3
"""Most steps of a fit without a part, from where all tests had led."""


@dataclass(frozen=True)
class HeldOut:
    """Predicted rows (m,), each by parameters that its own test did not set, and the log density of each row (m,)."""

    rows: NDArray[np.float64]
    log_density: NDArray[np.float64]

    @property
    def mean(self) -> float:
        """Mean log density of a row."""
        return float(np.mean(self.log_density))


def held_out_by_law(search: Search, rows: NDArray[np.float64]) -> HeldOut:
    """Left-out predictions (m,) of a learned law, with the noise scale and discrepancy that they show.

    In the units of the rows.
    """
    miss = search.data.measured - rows
    spread = misfit_of(search.data, miss).spread
    return HeldOut(rows, -0.5 * (miss**2 / spread + np.log(spread / search.data.variance)))


def hold_out(search: Search, mode: Mode, terms: tuple[Term, ...]) -> HeldOut:
    """Predictions of a hypothesis from its mode."""
    data = search.data
    rows, density = np.empty_like(data.measured), np.empty_like(data.measured)
    for fold in range(FOLDS):
        out = data.test % FOLDS == fold
        part = Search(search.plant, data, ~out)
        found = climb(part, terms, mode.values, mode.prediction.near, STEPS)
        rows[out] = found.prediction.rows[out]
        slopes = found.slopes[out]
        spread = found.misfit.noise**2 * data.variance + (found.misfit.discrepancy * data.reach) ** 2
        variance = spread[out] + np.einsum("ij,jk,ik->i", slopes, found.covariance(), slopes)
        miss = data.measured[out] - rows[out]
        density[out] = -0.5 * (miss**2 / variance + np.log(variance / data.variance[out]))
    return HeldOut(rows, density)
