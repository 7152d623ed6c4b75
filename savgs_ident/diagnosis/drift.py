"""Parameters that change while a campaign goes on, by more than the background tolerates.

The background takes up a drift of what is identified to first order: a friction or a damping whose relative change is
x at the end of the campaign, -x at its beginning, and in proportion to the time between. A friction that falls by a
fifth moves a dwell near its breakaway far beyond first order. So the drifts are estimated with a wide prior, the
baseline is solved for them at a few times of the campaign, and what they do beyond first order is added to all its
rows; that is repeated until it no longer changes. Unlike parameters, what drifts do beyond first order is that of
all tests where some are left out.

A baseline that drifts is a hypothesis like that of a tolerance that does not hold: where it is more probable than all
others, it takes the place of the baseline, and what is missing is looked for beside it.
"""

from dataclasses import replace
from math import log
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.presentation import Progress
from savgs_ident.diagnosis.dwell_problem import DwellProblem
from savgs_ident.diagnosis.evidence import DiagnosisEvidence, DiagnosisProblem
from savgs_ident.diagnosis.result import NONE
from savgs_ident.diagnosis.thresholds import DecisionConstants
from savgs_ident.inference.background.shared_errors import drifts_of, time_of, with_wider_drifts
from savgs_ident.inference.find_map import find_map, find_map_again
from savgs_ident.inference.laplace import is_hopeless
from savgs_ident.inference.laplace_fit import LaplaceFit, Search, search_of
from savgs_ident.inference.observations import Data

TIMES = (-1.0, -0.5, 0.0, 0.5, 1.0)
"""Times of a campaign, from -1 to 1, at which the drifting baseline is solved."""


class _Drifts(NamedTuple):
    """Drifts of the free parameters, in the widths of their prior, and the standard deviation of each, (n,)."""

    x: NDArray[np.float64]
    sd: NDArray[np.float64]


def drifting(
    problem: DiagnosisProblem, evidence: DiagnosisEvidence, progress: Progress
) -> DiagnosisProblem | None:
    """The problem with a baseline that drifts, where that is more probable than all of the evidence; else None.

    None, too, where the drifts that the baseline takes up to first order are within their tolerances.
    """
    plant, constants = problem.plant, problem.constants
    if not isinstance(plant, DwellProblem) or problem.data.tolerated is None or not plant.free:
        return None
    none = next(each for each in evidence.weighed if each.hypothesis == NONE)
    best = max(none.weight + constants.alarm_log_odds, *(each.weight for each in evidence.weighed))
    if np.abs(_drifts(problem.search, problem.base, len(plant.free)).x).max() < constants.least_drift:
        return None
    progress("looking for parameters that drift")
    prior = log(constants.prior_none) + log(constants.prior_broken_tolerance)
    width, known = constants.broken_tolerance_width, constants.drift_convergence
    data = with_wider_drifts(problem.data, len(plant.free), width)
    search, base = search_of(plant, data, problem.search.given), problem.base
    mode = find_map_again(search, (), base, 1)
    rise = mode.value - base.value
    if is_hopeless(mode.evidence - rise, rise, best - prior):
        return None
    drifts, moved = _Drifts(np.zeros(len(plant.free)), np.zeros(len(plant.free))), np.inf
    for _ in range(constants.drift_rounds):
        mode = find_map(search, (), mode.values, mode.prediction.warm_start)
        before, drifts = drifts, _drifts(search, mode, len(plant.free))
        moved = float(np.abs(drifts.x - before.x).max())
        if not mode.solved or moved < known / width:
            break
        curved = _curved(plant, data, mode, drifts.x, width * constants.drift_tolerance, constants)
        if curved is None:
            return None
        search = search_of(curved, data, problem.search.given)
    if not mode.solved or moved >= known / width or mode.evidence + prior < best:
        return None
    assert isinstance(search.plant, DwellProblem)
    change = 2.0 * width * constants.drift_tolerance * drifts.x
    certain = {
        name: float(each)
        for name, each, sure in zip(plant.free, change, np.abs(drifts.x) / drifts.sd, strict=True)
        if sure > constants.significant_drift
    }
    return replace(problem, plant=search.plant, data=data, search=search, base=mode, drifts=certain)


def _drifts(search: Search, mode: LaplaceFit, count: int) -> _Drifts:
    """The drifts beside a fit, normal about their means."""
    spread, noise = mode.noise_scales.spread, mode.noise_scales.noise
    moved = noise * search.turned(drifts_of(search.data, count))
    slopes, weighted = search.turned(mode.slopes), moved / spread[:, None]
    cross = slopes.T @ weighted
    information = moved.T @ weighted - cross.T @ np.linalg.solve(mode.precision, cross)
    covariance = np.eye(count) - information
    sd = noise * np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    return _Drifts(search.tolerated_errors(mode)[-count:], sd)


def _curved(
    plant: DwellProblem,
    data: Data,
    mode: LaplaceFit,
    x: NDArray[np.float64],
    tolerance: float,
    constants: DecisionConstants,
) -> DwellProblem | None:
    """The plant with what drifts ``x`` (n,), in their ``tolerance``, do to its rows beyond first order.

    None where the baseline has no solution on the way.
    """
    centre, start = mode.values, mode.prediction.warm_start
    without = replace(plant, beyond=None)
    levels = []
    for time in TIMES:
        share = np.maximum(1.0 + time * tolerance * x, constants.least_parameter_share)
        there = {name: centre[name] * float(each) for name, each in zip(plant.free, share, strict=True)}
        found = without.predict((), centre | there, (), start)
        if not found.solved:
            return None
        levels.append(found.rows)
    at = time_of(plant.times)[data.test]
    drifted = sum(
        (weight * rows for weight, rows in zip(_lagrange(at), levels, strict=True)),
        start=np.zeros_like(at),
    )
    first = drifts_of(data, x.size) @ x
    return replace(plant, beyond=drifted - levels[TIMES.index(0.0)] - first)


def _lagrange(at: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Weights (m,) of the rows at each of the times in those at the times ``at`` (m,): a polynomial through all."""
    return [
        np.prod([(at - other) / (each - other) for other in TIMES if other != each], axis=0) for each in TIMES
    ]
