"""Where the gap comes from: the smallest unknown signal at each place of the plant that explains it.

Two questions are asked of every place. How much could any signal there explain, free in every test (its reach)?
And how much of the tests left out does a law explain that was learned from the others (its share)? A law is a
sum of given functions of what the place sees, with normal coefficients; the baseline's parameters are free
beside it, so that it gets no credit for what recalibration can do.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, log
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnose.engine.climb import Mode, Search
from savgs_ident.diagnose.engine.coordinates import reach_of
from savgs_ident.diagnose.engine.linear import best_of, log_determinant

Matrix = NDArray[np.float64]

FOLDS = 4
"""Parts into which the tests are split: each is left out once."""

SIZES = (0.3, 3.0, 30.0)
"""Widths of a coefficient's prior, in rms of the rows in their sd, among which the evidence chooses."""

FREE_SIZE = 100.0
"""The same of a free signal: wide, so that its reach is an upper bound."""


class Law(NamedTuple):
    """Change of the rows per function of a law, the same in all tests, (m, q); how probable the law is beforehand.

    Probabilities count beside those of the other laws of a place. ``columns`` are in the units of the rows,
    per size of a function [1].
    """

    columns: Matrix
    prior: float = 1.0


@dataclass(frozen=True)
class Place:
    """What a place can do to the rows.

    Attributes:
        name: its name.
        laws: that the place may follow, one of them.
        free: change of the rows per component of a free signal, in each test its own [unit of the row], (m, f).
    """

    name: str
    laws: tuple[Law, ...]
    free: Matrix


@dataclass(frozen=True)
class Attribution:
    """What a place explains.

    Attributes:
        name: name of the place.
        share: share of the gap in left-out tests that the most probable law explains; 0 if it makes it worse.
        reach: share that a free signal explains.
        evidence: log evidence of the baseline with a law, linearised, over all laws and widths of their priors.
        held_out: rows (m,) [their units] of each test, predicted by the law and parameters that the others set.
        coefficients: those of the free signal by test [its unit], (tests, f).
    """

    name: str
    share: float
    reach: float
    evidence: float
    held_out: NDArray[np.float64]
    coefficients: NDArray[np.float64]


def attribute(search: Search, mode: Mode, places: list[Place]) -> list[Attribution]:
    """What every place explains beyond a mode, the largest share first."""
    found = [_attribution(search, mode, place) for place in places]
    return sorted(found, key=lambda each: -each.share)


def anywhere(places: Sequence[Attribution]) -> float:
    """Log evidence of a law at one of the places, no matter which."""
    return _mean_of([each.evidence for each in places])


def widths_of(search: Search, mode: Mode, columns: Matrix) -> NDArray[np.float64]:
    """Standard deviations (q,) of a law's coefficients before the data, at the size that suits them best.

    ``columns`` (m, q) are the change of the rows per unit of each.
    """
    weight = 1.0 / np.sqrt(mode.misfit.spread)
    size, _ = _best_size(search, mode, _scaled(columns, weight))
    reach = np.sqrt(np.mean((columns * weight[:, None]) ** 2, axis=0))
    return np.asarray(size / np.where(reach > 0.0, reach, 1.0))


def _mean_of(evidences: Sequence[float]) -> float:
    """Log of the mean of what has these logs: any may hold, none is preferred."""
    best = max(evidences)
    return best + log(sum(exp(each - best) for each in evidences) / len(evidences))


def _attribution(search: Search, mode: Mode, place: Place) -> Attribution:
    weight = 1.0 / np.sqrt(mode.misfit.spread)
    laws = [_scaled(each.columns, weight) for each in place.laws]
    sizes, evidences = zip(*(_best_size(search, mode, each) for each in laws), strict=True)
    priors = np.array([each.prior for each in place.laws])
    weights = np.array(evidences) + np.log(priors / priors.sum())
    law, size = laws[int(np.argmax(weights))], sizes[int(np.argmax(weights))]
    evidence = float(np.logaddexp.reduce(weights))
    reach, coefficients = _reach(search, mode, place.free, weight)
    without, missed = (_left_out(search, mode, each, weight) for each in (law * 0.0, law * size))
    whole = float(np.sum((without * weight) ** 2))
    share = max(0.0, 1.0 - float(np.sum((missed * weight) ** 2)) / whole) if whole > 0.0 else 0.0
    held_out = search.data.measured - missed
    return Attribution(place.name, share, reach, evidence, held_out, coefficients)


def _scaled(columns: Matrix, weight: NDArray[np.float64]) -> Matrix:
    """Columns of unit rms in units of the rows' sd; what does nothing stays nothing."""
    size = np.sqrt(np.mean((columns * weight[:, None]) ** 2, axis=0))
    return columns / np.where(size > 0.0, size, 1.0)


def _best_size(search: Search, mode: Mode, law: Matrix) -> tuple[float, float]:
    residual = search.residual(mode.prediction)
    lower, upper = reach_of(mode.coordinates)
    wide = np.full(law.shape[1], np.inf)
    bounds = np.concatenate([lower, -wide]), np.concatenate([upper, wide])
    start = np.concatenate([mode.x, np.zeros(law.shape[1])])
    halved = log(2.0) * sum(each.halved for each in mode.coordinates)
    found = []
    for size in SIZES:
        top = best_of(search.data, residual, np.concatenate([mode.slopes, size * law], axis=1), start, bounds)
        found.append(top.value - 0.5 * log_determinant(top.precision) + halved)
    return SIZES[int(np.argmax(found))], _mean_of(found)


def _left_out(search: Search, mode: Mode, law: Matrix, weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """Residuals (m,) of every test when the others have set the parameters and the law's coefficients."""
    residual = search.residual(mode.prediction)
    slopes = np.concatenate([mode.slopes, law], axis=1)
    x = np.concatenate([mode.x, np.zeros(law.shape[1])])
    missed = residual.copy()
    for fold in range(FOLDS):
        out = search.data.test % FOLDS == fold
        inside = slopes[~out] * weight[~out, None]
        if not out.any() or out.all():
            continue
        precision = np.eye(x.size) + inside.T @ inside
        step = np.linalg.solve(precision, inside.T @ (residual * weight)[~out] - x)
        missed[out] = residual[out] - slopes[out] @ step
    return missed


def _reach(
    search: Search, mode: Mode, free: Matrix, weight: NDArray[np.float64]
) -> tuple[float, NDArray[np.float64]]:
    """Share of the gap that signals free in every test explain, the parameters set anew; and the signals."""
    residual = search.residual(mode.prediction) * weight
    slopes, signal = mode.slopes * weight[:, None], _scaled(free, weight) * weight[:, None] * FREE_SIZE
    tests = [np.flatnonzero(search.data.test == test) for test in range(search.data.tests)]
    removed_residual, removed_slopes = residual.copy(), slopes.copy()
    inverses = []
    for rows in tests:
        mine = signal[rows]
        inverse = np.linalg.solve(np.eye(mine.shape[1]) + mine.T @ mine, mine.T)
        inverses.append(inverse)
        removed_residual[rows] -= mine @ (inverse @ residual[rows])
        removed_slopes[rows] -= mine @ (inverse @ slopes[rows])
    precision = np.eye(mode.x.size) + slopes.T @ removed_slopes
    step = np.linalg.solve(precision, removed_slopes.T @ residual - mode.x)
    left = float(np.sum((removed_residual - removed_slopes @ step) ** 2))
    size = np.sqrt(np.mean((free * weight[:, None]) ** 2, axis=0))
    coefficients = np.stack(
        [
            inverse @ (residual[rows] - slopes[rows] @ step) * FREE_SIZE / np.where(size > 0.0, size, 1.0)
            for rows, inverse in zip(tests, inverses, strict=True)
        ]
    )
    whole = float(np.sum(residual**2))
    return (max(0.0, 1.0 - left / whole) if whole > 0.0 else 0.0), coefficients
