"""Predictions of tests that a hypothesis has not seen: each is left out once, the others set the parameters."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.inference.find_map import LaplaceFit, Search, find_map
from savgs_ident.inference.noise_scales import NoiseScales
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
        rows[out], density[out] = predict_left_out(
            part,
            out,
            found.prediction.rows,
            found.slopes,
            part.missed(found.prediction),
            found.covariance(),
            found.noise_scales,
        )
    return HeldOut(rows, density)


def predict_left_out(
    part: Search,
    out: NDArray[np.bool_],
    rows: NDArray[np.float64],
    slopes: NDArray[np.float64],
    missed: NDArray[np.float64],
    covariance: NDArray[np.float64],
    scales: NoiseScales,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The rows that are left ``out`` (m,), as the ``part`` predicts them, and the log density of each.

    ``rows`` (m,) [unit of each] are those of a model fitted to the part, which it ``missed`` as independent rows,
    with ``slopes`` (m, n) in coordinates that have this ``covariance`` (n, n). Errors within tolerances are shared by
    all tests, so that those of the part tell what they are in the others.
    """
    data = part.data
    spread = part.rows.marginal(scales.noise, scales.discrepancy)
    variance = data.marginal(scales.noise, scales.discrepancy)[out]
    predicted, steep = rows[out], slopes[out]
    if data.tolerated is not None:
        known = scales.noise**2 * data.tolerated[out] @ part.turned(data.tolerated).T
        weights = known / spread
        predicted = predicted + weights @ missed
        steep = steep - weights @ part.turned(slopes)
        variance = variance - np.sum(weights * known, axis=1)
    variance = variance + np.einsum("ij,jk,ik->i", steep, covariance, steep)
    miss = data.measured[out] - predicted
    return predicted, -0.5 * (miss**2 / variance + np.log(variance / data.variance[out]))
