"""Predictions of tests that a hypothesis has not seen: each is left out once, the others set the parameters.

The folds are interleaved: every so many-th test. The last third of the tests, the fastest dwells and behind them
windows of roads, is left out together besides: a law that only interpolates predicts these badly.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.threads import in_parallel
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.inference.find_map import STEPS, find_map_again
from savgs_ident.inference.laplace_fit import LaplaceFit, Search
from savgs_ident.inference.likelihood import NoiseScales
from savgs_ident.inference.observations import Data, Plant, Prediction, Term
from savgs_ident.inference.prior import Coordinates


@dataclass(frozen=True)
class HeldOut:
    """What is predicted of tests by parameters that they did not set.

    Attributes:
        rows: the predicted rows [unit of each], (m,).
        log_density: log density of each row in its noise, (m,).
        evidence: log evidence without each fold, (folds,); empty for a law that is known to first order alone.
        beyond: mean log density of the rows of the last tests, predicted by all before; NaN where there are too few.
    """

    rows: NDArray[np.float64]
    log_density: NDArray[np.float64]
    evidence: tuple[float, ...] = ()
    beyond: float = nan

    @property
    def mean(self) -> float:
        """Mean log density of a row."""
        return float(np.mean(self.log_density))

    @property
    def total(self) -> float:
        """Log density of all rows."""
        return float(np.sum(self.log_density))


@dataclass(frozen=True)
class _NearFit:
    """A plant near a fit, with the slopes that it has at the fit: to find them takes longer than to find a motion."""

    plant: Plant
    fit: LaplaceFit

    @property
    def nuisances(self) -> Coordinates:
        return self.plant.nuisances

    def predict(
        self, terms: tuple[str, ...], values: Mapping[str, float], names: Sequence[str], warm_start: Any
    ) -> Prediction:
        found = self.plant.predict(terms, values, (), warm_start)
        return replace(found, find_slopes=lambda: self.fit.prediction.slopes) if names else found

    def refined(self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any) -> Any:
        return self.plant.refined(terms, values, warm_start)

    def sensitivities(
        self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any, candidates: Sequence[Term]
    ) -> list[NDArray[np.float64]]:
        return self.plant.sensitivities(terms, values, warm_start, candidates)


def find_map_near(search: Search, terms: tuple[Term, ...], fit: LaplaceFit, steps: int = STEPS) -> LaplaceFit:
    """The mode near a ``fit`` of the same plant with the same terms, by the slopes that the rows have at the fit.

    For other rows of the same data: without some of the tests the mode is a few of its standard deviations away,
    where the slopes are still those of the fit.
    """
    return find_map_again(replace(search, plant=_NearFit(search.plant, fit)), terms, fit, steps)


def hold_out(
    search: Search, mode: LaplaceFit, terms: tuple[Term, ...], constants: DecisionConstants = DEFAULTS
) -> HeldOut:
    """Predictions of a hypothesis with ``terms``, fitted without each part of the tests from its fit to all."""
    data = search.data

    def without(out: NDArray[np.bool_]) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        part = Search(search.plant, data, ~out)
        found = find_map_near(part, terms, mode, constants.held_out_steps)
        if not found.solved:
            # What has no solution predicts nothing.
            count = int(out.sum())
            return np.zeros(count), np.full(count, -np.inf), -np.inf
        rows, density = predict_left_out(
            part,
            out,
            found.prediction.rows,
            found.slopes,
            part.missed(found.prediction),
            found.covariance(),
            found.noise_scales,
        )
        return rows, density, found.evidence

    folds = folds_of(data, constants)
    last = data.test >= data.tests - data.tests // constants.held_out_folds
    parts = in_parallel(without, [*folds, last] if last.any() else folds)
    rows, density = np.empty_like(data.measured), np.empty_like(data.measured)
    for out, (theirs, dense, _) in zip(folds, parts, strict=False):
        rows[out], density[out] = theirs, dense
    evidence = tuple(each for _, _, each in parts[: len(folds)])
    return HeldOut(rows, density, evidence, float(np.mean(parts[-1][1])) if last.any() else nan)


def folds_of(data: Data, constants: DecisionConstants = DEFAULTS) -> list[NDArray[np.bool_]]:
    """Rows (m,) of each interleaved part of the tests."""
    return [data.test % constants.held_out_folds == fold for fold in range(constants.held_out_folds)]


def select_in_folds(
    data: Data, held: Sequence[HeldOut], priors: Sequence[float], constants: DecisionConstants = DEFAULTS
) -> NDArray[np.float64]:
    """Rows (m,) [unit of each] of each test, predicted by the hypothesis that the others find most probable.

    ``priors`` are the log priors of the hypotheses. No test that is predicted took part in fitting or selecting.
    """
    weights = np.array([each.evidence for each in held]) + np.array(priors)[:, None]
    rows = np.empty_like(data.measured)
    for out, best in zip(folds_of(data, constants), np.argmax(weights, axis=0), strict=True):
        rows[out] = held[best].rows[out]
    return rows


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
    all tests, so that those of the part determine those of the others.
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
    # How the tests that are left out begin they alone know.
    own, miss = data.part(out), data.measured[out] - predicted
    miss = miss - own.explained_by_nuisances(miss)
    steep = steep - own.explained_by_nuisances(steep)
    predicted = data.measured[out] - miss
    variance = variance + np.einsum("ij,jk,ik->i", steep, covariance, steep)
    # The normal density of as many numbers as nuisances leave.
    width = own.left_by_nuisances * np.log(variance / data.variance[out])
    return predicted, -0.5 * (miss**2 / variance + width)
