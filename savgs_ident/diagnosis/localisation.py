"""Where the gap comes from: the smallest unknown input at each location of the plant that explains it.

Two questions are asked of every location. How much could any input there explain, free in every dwell (its
free-input share)? And how much of the tests left out does a law explain that was learned from the others (its share)?
A law is a sum of given functions of the signals at the location, with normal coefficients; the baseline's parameters
are free beside it, so that it gets no credit for what recalibration can do.

All is linearised about a fit: rows r + J d, coordinates with unit-normal priors, a law's coefficients normal with one
of the widths ``law_widths``. The log evidence of a location is averaged over its laws and over the widths.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import exp, log
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnosis.held_out import HeldOut, predict_left_out
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.effects.base import Family
from savgs_ident.inference.background.port_functions import InputLocation, Matrix
from savgs_ident.inference.laplace import linearised_optimum, log_evidence
from savgs_ident.inference.laplace_fit import LaplaceFit, Search
from savgs_ident.inference.likelihood import NoiseScales
from savgs_ident.inference.observations import Data
from savgs_ident.inference.prior import bounds_of


@dataclass(frozen=True)
class Localisation:
    """What an unknown input at a location explains.

    Attributes:
        name: name of the location.
        share: share of the gap in left-out tests that the most probable law explains; 0 if it makes it worse.
        free_input_share: share that a free input explains.
        evidence: log evidence of the fit with a law, linearised, over all laws and widths of their priors.
        held_out: each test, predicted by the law and parameters that the others set.
        moved: by how much the law moves these predictions, parameters estimated anew [unit of each row], (m,).
        free_input: coefficients of the free input by test [its unit], (tests, f).
        families: log weight of the laws of each family, prior included; those that mix several are under None.
        ports: the same of the laws at each port, by its name.
    """

    name: str
    share: float
    free_input_share: float
    evidence: float
    held_out: HeldOut
    moved: NDArray[np.float64]
    free_input: NDArray[np.float64]
    families: Mapping[Family | None, float] = field(default_factory=dict)
    ports: Mapping[str, float] = field(default_factory=dict)


def localise(
    search: Search,
    mode: LaplaceFit,
    locations: Sequence[InputLocation],
    constants: DecisionConstants = DEFAULTS,
) -> list[Localisation]:
    """What an input at every location explains beyond a fit, the largest share first."""
    folds = _folds_of(search, mode, constants.location_folds)
    fit = _linearised(search, mode)
    found = [_localisation(search, fit, each, folds, constants) for each in locations]
    return sorted(found, key=lambda each: -each.share)


def anywhere(localisations: Sequence[Localisation]) -> float:
    """Log evidence of a law at one of the locations, each with equal probability."""
    return _log_mean_exp([each.evidence for each in localisations])


def widths_of(
    search: Search, mode: LaplaceFit, columns: Matrix, constants: DecisionConstants = DEFAULTS
) -> NDArray[np.float64]:
    """Prior standard deviations (q,) of a law's coefficients, at the width with the greatest evidence.

    ``columns`` (m, q) are the change of the rows per unit of each.
    """
    across = search.turned(columns)
    rms = _rms(mode, across)
    return np.asarray(_best_width(_linearised(search, mode), across / rms, constants).width / rms)


def evidence_of_law(
    search: Search, mode: LaplaceFit, columns: Matrix, constants: DecisionConstants = DEFAULTS
) -> float:
    """Log evidence with a law whose coefficients change the rows by ``columns``, (m, q), to first order."""
    across = search.turned(columns)
    return _best_width(_linearised(search, mode), across / _rms(mode, across), constants).evidence


def _log_mean_exp(evidences: Sequence[float]) -> float:
    best = max(evidences)
    return best + log(sum(exp(each - best) for each in evidences) / len(evidences))


class _Fold(NamedTuple):
    """A fit without some of the tests, linearised.

    Attributes:
        out: rows of the tests that are left out, (m,).
        search: what counts without them.
        slopes: of its independent rows in the coordinates.
        missed: how far the fit misses these rows.
    """

    out: NDArray[np.bool_]
    search: Search
    slopes: Matrix
    missed: NDArray[np.float64]


def _folds_of(search: Search, mode: LaplaceFit, count: int) -> list[_Fold]:
    """The fit without every so many-th test; none where that leaves no test, or leaves out none."""
    found = []
    for fold in range(count):
        out = search.data.test % count == fold
        if not out.any() or out.all():
            continue
        part = Search(search.plant, search.data, ~out)
        found.append(_Fold(out, part, part.turned(mode.slopes), part.missed(mode.prediction)))
    return found


class _Linearised(NamedTuple):
    """A fit as laws are tried beside it.

    Attributes:
        mode: the fit.
        rows: the independent rows.
        missed: how far it misses them.
        slopes: theirs in its coordinates.
    """

    mode: LaplaceFit
    rows: Data
    missed: NDArray[np.float64]
    slopes: Matrix


def _linearised(search: Search, mode: LaplaceFit) -> _Linearised:
    return _Linearised(mode, search.rows, search.missed(mode.prediction), search.turned(mode.slopes))


def _localisation(
    search: Search,
    fit: _Linearised,
    location: InputLocation,
    folds: Sequence[_Fold],
    constants: DecisionConstants,
) -> Localisation:
    mode = fit.mode
    weight = 1.0 / np.sqrt(search.data.marginal(mode.noise_scales.noise, mode.noise_scales.discrepancy))
    turned = [search.turned(each.columns) for each in location.laws]
    rms = [_rms(mode, each) for each in turned]
    fitted = [_best_width(fit, each / size, constants) for each, size in zip(turned, rms, strict=True)]
    priors = np.array([each.prior for each in location.laws])
    weights = np.array([each.evidence for each in fitted]) + np.log(priors / priors.sum())
    first = int(np.argmax(weights))
    law, best = location.laws[first].columns / rms[first], fitted[first]
    evidence = float(np.logaddexp.reduce(weights))
    free_share, free_input = _free_input(search, mode, location.free, weight, constants.free_input_width)
    without = _left_out(search, mode, law[:, :0], folds, mode.noise_scales)
    held_out = _left_out(search, mode, law * best.width, folds, best.noise_scales)
    whole, left = (
        float(np.sum(((search.data.measured - each.rows) * weight) ** 2)) for each in (without, held_out)
    )
    share = max(0.0, 1.0 - left / whole) if whole > 0.0 else 0.0
    families: dict[Family | None, float] = {}
    ports: dict[str, float] = {}
    for each, one in zip(location.laws, weights.tolist(), strict=True):
        families[each.family] = float(np.logaddexp(families.get(each.family, -np.inf), one))
        ports[each.port] = float(np.logaddexp(ports.get(each.port, -np.inf), one))
    moved = held_out.rows - without.rows
    return Localisation(
        location.name, share, free_share, evidence, held_out, moved, free_input, families, ports
    )


def _rms(mode: LaplaceFit, turned: Matrix) -> NDArray[np.float64]:
    """Root mean squares (q,) of columns (m, q) of independent rows, in their sd; 1 for what does nothing."""
    squares = turned**2 / mode.noise_scales.spread[:, None]
    size = np.sqrt(np.mean(squares, axis=0))
    return np.where(size > 0.0, size, 1.0)


class _Width(NamedTuple):
    """The prior width of a law's coefficients with the greatest log evidence.

    Attributes:
        width: in rms of the residuals in their sd [1].
        evidence: log evidence, averaged over all widths.
        noise_scales: noise scale and discrepancy beside the law.
    """

    width: float
    evidence: float
    noise_scales: NoiseScales


def _best_width(fit: _Linearised, law: Matrix, constants: DecisionConstants) -> _Width:
    """The best of all widths of the prior; ``law`` (m, q) is what coefficients change in the independent rows."""
    mode = fit.mode
    lower, upper = bounds_of(mode.coordinates)
    wide = np.full(law.shape[1], np.inf)
    bounds = np.concatenate([lower, -wide]), np.concatenate([upper, wide])
    start = np.concatenate([mode.x, np.zeros(law.shape[1])])
    found, tops = [], []
    for width in constants.law_widths:
        slopes = np.concatenate([fit.slopes, width * law], axis=1)
        top = linearised_optimum(fit.rows, fit.missed, slopes, start, bounds, scales=mode.noise_scales)
        tops.append(top)
        found.append(log_evidence(tops[-1].value, tops[-1].precision, mode.coordinates))
    best = int(np.argmax(found))
    return _Width(constants.law_widths[best], _log_mean_exp(found), tops[best].noise_scales)


def _left_out(
    search: Search, mode: LaplaceFit, law: Matrix, folds: Sequence[_Fold], scales: NoiseScales
) -> HeldOut:
    """Every test when the others have set the parameters and the law's coefficients; the fit if none is left out."""
    prediction = mode.prediction
    slopes = np.concatenate([mode.slopes, law], axis=1)
    x = np.concatenate([mode.x, np.zeros(law.shape[1])])
    rows, density = prediction.rows.copy(), np.zeros(prediction.rows.size)
    for fold in folds:
        inside = np.concatenate([fold.slopes, fold.search.turned(law)], axis=1)
        weighted = inside / fold.search.rows.marginal(scales.noise, scales.discrepancy)[:, None]
        covariance = np.linalg.inv(np.eye(x.size) + weighted.T @ inside)
        step = covariance @ (weighted.T @ fold.missed - x)
        rows[fold.out], density[fold.out] = predict_left_out(
            fold.search,
            fold.out,
            prediction.rows + slopes @ step,
            slopes,
            fold.missed - inside @ step,
            covariance,
            scales,
        )
    return HeldOut(rows, density)


def _free_input(
    search: Search, mode: LaplaceFit, free: Matrix, weight: NDArray[np.float64], width: float
) -> tuple[float, NDArray[np.float64]]:
    """Share of the gap that inputs free in every dwell explain, parameters estimated anew; and the inputs.

    The coefficients of the inputs are eliminated test by test, which leaves a system in the parameters alone. The
    share is of the gap in tests where such an input does anything: windows have none.
    """
    residual, slopes = search.residual(mode.prediction) * weight, mode.slopes * weight[:, None]
    scale = np.sqrt(np.mean((free * weight[:, None]) ** 2, axis=0))
    per_unit = width / np.where(scale > 0.0, scale, 1.0)
    signal = free * weight[:, None] * per_unit
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
    acting = np.isin(search.data.test, [test for test, rows in enumerate(tests) if signal[rows].any()])
    left = float(np.sum((removed_residual - removed_slopes @ step)[acting] ** 2))
    coefficients = np.stack(
        [
            inverse @ (residual[rows] - slopes[rows] @ step) * per_unit
            for rows, inverse in zip(tests, inverses, strict=True)
        ]
    )
    whole = float(np.sum(residual[acting] ** 2))
    return (max(0.0, 1.0 - left / whole) if whole > 0.0 else 0.0), coefficients
