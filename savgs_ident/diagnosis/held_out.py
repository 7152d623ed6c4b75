"""Predictions of tests that a hypothesis has not seen: each is left out once, the others set the parameters."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.inference.find_map import LaplaceFit, Search, find_map
from savgs_ident.inference.noise_scales import noise_scales
from savgs_ident.inference.observations import Term


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
    """Left-out predictions (m,) [unit of each row] of a learned law, with the noise scales that they show."""
    data = replace(search.data, shared=None)
    miss = data.measured - rows
    spread = noise_scales(data, miss).spread
    return HeldOut(rows, -0.5 * (miss**2 / spread + np.log(spread / data.variance)))


def hold_out(
    search: Search, mode: LaplaceFit, terms: tuple[Term, ...], constants: DecisionConstants = DEFAULTS
) -> HeldOut:
    """Predictions of a hypothesis with ``terms``, fitted without each part of the tests from its fit to all."""
    data, folds = search.data, constants.held_out_folds
    rows, density = np.empty_like(data.measured), np.empty_like(data.measured)
    for fold in range(folds):
        out = data.test % folds == fold
        part = Search(search.plant, data, ~out)
        found = find_map(part, terms, mode.values, mode.prediction.warm_start, constants.held_out_steps)
        rows[out] = found.prediction.rows[out] + _by_tolerated(part, found, out)
        slopes = found.slopes[out]
        spread = data.marginal(found.noise_scales.noise, found.noise_scales.discrepancy)
        variance = spread[out] + np.einsum("ij,jk,ik->i", slopes, found.covariance(), slopes)
        miss = data.measured[out] - rows[out]
        density[out] = -0.5 * (miss**2 / variance + np.log(variance / data.variance[out]))
    return HeldOut(rows, density)


def _by_tolerated(part: Search, found: LaplaceFit, out: NDArray[np.bool_]) -> NDArray[np.float64] | float:
    """What errors within tolerances, as the other tests have set them, change in the rows that are left ``out``."""
    tolerated = part.data.tolerated
    if tolerated is None:
        return 0.0
    scales = found.noise_scales
    weights = part.part.weights(part.missed(found.prediction) / scales.spread)
    return np.asarray(scales.noise**2 * tolerated[out] @ (tolerated[part.mask].T @ weights))
