"""Where the gap comes from: the smallest unknown input at each location of the plant that explains it.

Two questions are asked of every location. How much could any input there explain, free in every test (its free-input
share)? And how much of the tests left out does a law explain that was learned from the others (its share)? A law is a
sum of given functions of the signals at the location, with normal coefficients; the baseline's parameters are free
beside it, so that it gets no credit for what recalibration can do.

All is linearised about a fit: rows r + J d, coordinates with unit-normal priors, a law's coefficients normal with one
of the widths ``law_widths``. The log evidence of a location is averaged over its laws and over the widths.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import exp, log
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.effects.base import Family
from savgs_ident.inference.find_map import LaplaceFit, Search
from savgs_ident.inference.laplace import log_evidence
from savgs_ident.inference.noise_scales import linearised_optimum
from savgs_ident.inference.prior import bounds_of

Matrix = NDArray[np.float64]


class Law(NamedTuple):
    """A law at a location, linear in its coefficients.

    Attributes:
        columns: change of the rows per function of the law, the same in all tests [unit of the row], (m, q).
        prior: its prior probability relative to the other laws of the location.
        whole: whether it may be any sum of a set of functions; a few of them otherwise.
        family: what kind of thing it is; None where it mixes several.
        port: name of the port where it acts; empty where that has no learned law.
    """

    columns: Matrix
    prior: float = 1.0
    whole: bool = True
    family: Family | None = None
    port: str = ""


@dataclass(frozen=True)
class InputLocation:
    """What an input at a location can do to the rows.

    Attributes:
        name: its name.
        laws: that the input may follow, one of them.
        free: change of the rows per component of a free input, in each test its own [unit of the row], (m, f).
    """

    name: str
    laws: tuple[Law, ...]
    free: Matrix

    @property
    def functions(self) -> Matrix:
        """What all functions do of which its laws consist [unit of the row], (m, q)."""
        return np.concatenate([law.columns for law in self.laws if law.whole], axis=1)


@dataclass(frozen=True)
class Localisation:
    """What an unknown input at a location explains.

    Attributes:
        name: name of the location.
        share: share of the gap in left-out tests that the most probable law explains; 0 if it makes it worse.
        free_input_share: share that a free input explains.
        evidence: log evidence of the fit with a law, linearised, over all laws and widths of their priors.
        held_out: rows (m,) [their units] of each test, predicted by the law and parameters that the others set.
        free_input: coefficients of the free input by test [its unit], (tests, f).
        families: log weight of the laws of each family, prior included; those that mix several are under None.
        ports: the same of the laws at each port, by its name.
    """

    name: str
    share: float
    free_input_share: float
    evidence: float
    held_out: NDArray[np.float64]
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
    found = [_localisation(search, mode, each, folds, constants) for each in locations]
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
    rms = _rms(search, mode, columns)
    width, _ = _best_width(search, mode, columns / rms, constants)
    return np.asarray(width / rms)


def _log_mean_exp(evidences: Sequence[float]) -> float:
    best = max(evidences)
    return best + log(sum(exp(each - best) for each in evidences) / len(evidences))


class _Fold(NamedTuple):
    """A fit without some of the tests, linearised.

    Attributes:
        out: rows of the tests that are left out, (m,).
        search: what counts without them.
        weight: of its independent rows, one over their sd.
        slopes: of these in the coordinates, weighed.
        missed: how far the fit misses them, weighed.
    """

    out: NDArray[np.bool_]
    search: Search
    weight: NDArray[np.float64]
    slopes: Matrix
    missed: NDArray[np.float64]


def _folds_of(search: Search, mode: LaplaceFit, count: int) -> list[_Fold]:
    """The fit without every so many-th test; none where that leaves no test, or leaves out none."""
    found, scales = [], mode.noise_scales
    for fold in range(count):
        out = search.data.test % count == fold
        if not out.any() or out.all():
            continue
        part = Search(search.plant, search.data, ~out)
        weight = 1.0 / np.sqrt(part.rows.marginal(scales.noise, scales.discrepancy))
        slopes, missed = part.turned(mode.slopes), part.missed(mode.prediction)
        found.append(_Fold(out, part, weight, slopes * weight[:, None], missed * weight))
    return found


def _localisation(
    search: Search,
    mode: LaplaceFit,
    location: InputLocation,
    folds: Sequence[_Fold],
    constants: DecisionConstants,
) -> Localisation:
    weight = 1.0 / np.sqrt(search.data.marginal(mode.noise_scales.noise, mode.noise_scales.discrepancy))
    laws = [each.columns / _rms(search, mode, each.columns) for each in location.laws]
    widths, evidences = zip(*(_best_width(search, mode, each, constants) for each in laws), strict=True)
    priors = np.array([each.prior for each in location.laws])
    weights = np.array(evidences) + np.log(priors / priors.sum())
    law, width = laws[int(np.argmax(weights))], widths[int(np.argmax(weights))]
    evidence = float(np.logaddexp.reduce(weights))
    free_share, free_input = _free_input(search, mode, location.free, weight, constants.free_input_width)
    without, missed = (_left_out(search, mode, each, folds) for each in (law * 0.0, law * width))
    whole = float(np.sum((without * weight) ** 2))
    share = max(0.0, 1.0 - float(np.sum((missed * weight) ** 2)) / whole) if whole > 0.0 else 0.0
    held_out = search.data.measured - missed
    families: dict[Family | None, float] = {}
    ports: dict[str, float] = {}
    for each, one in zip(location.laws, weights.tolist(), strict=True):
        families[each.family] = float(np.logaddexp(families.get(each.family, -np.inf), one))
        ports[each.port] = float(np.logaddexp(ports.get(each.port, -np.inf), one))
    return Localisation(location.name, share, free_share, evidence, held_out, free_input, families, ports)


def _rms(search: Search, mode: LaplaceFit, columns: Matrix) -> NDArray[np.float64]:
    """Root mean squares (q,) of columns (m, q) as independent rows, in their sd; 1 for what does nothing."""
    squares = search.turned(columns) ** 2 / mode.noise_scales.spread[:, None]
    size = np.sqrt(np.mean(squares, axis=0))
    return np.where(size > 0.0, size, 1.0)


def _best_width(
    search: Search, mode: LaplaceFit, law: Matrix, constants: DecisionConstants
) -> tuple[float, float]:
    """The width of the prior with the greatest log evidence, and the log evidence averaged over all widths."""
    missed, inside, across = search.missed(mode.prediction), search.turned(mode.slopes), search.turned(law)
    lower, upper = bounds_of(mode.coordinates)
    wide = np.full(law.shape[1], np.inf)
    bounds = np.concatenate([lower, -wide]), np.concatenate([upper, wide])
    start = np.concatenate([mode.x, np.zeros(law.shape[1])])
    found = []
    for width in constants.law_widths:
        slopes = np.concatenate([inside, width * across], axis=1)
        top = linearised_optimum(search.rows, missed, slopes, start, bounds)
        found.append(log_evidence(top.value, top.precision, mode.coordinates))
    return constants.law_widths[int(np.argmax(found))], _log_mean_exp(found)


def _left_out(search: Search, mode: LaplaceFit, law: Matrix, folds: Sequence[_Fold]) -> NDArray[np.float64]:
    """Residuals (m,) of every test when the others have set the parameters and the law's coefficients."""
    residual = search.residual(mode.prediction)
    slopes = np.concatenate([mode.slopes, law], axis=1)
    x = np.concatenate([mode.x, np.zeros(law.shape[1])])
    missed = residual.copy()
    for fold in folds:
        across = fold.search.turned(law) * fold.weight[:, None]
        inside = np.concatenate([fold.slopes, across], axis=1)
        precision = np.eye(x.size) + inside.T @ inside
        step = np.linalg.solve(precision, inside.T @ fold.missed - x)
        missed[fold.out] = residual[fold.out] - slopes[fold.out] @ step
    return missed


def _free_input(
    search: Search, mode: LaplaceFit, free: Matrix, weight: NDArray[np.float64], width: float
) -> tuple[float, NDArray[np.float64]]:
    """Share of the gap that inputs free in every test explain, parameters estimated anew; and the inputs.

    The coefficients of the inputs are eliminated test by test, which leaves a system in the parameters alone.
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
    left = float(np.sum((removed_residual - removed_slopes @ step) ** 2))
    coefficients = np.stack(
        [
            inverse @ (residual[rows] - slopes[rows] @ step) * per_unit
            for rows, inverse in zip(tests, inverses, strict=True)
        ]
    )
    whole = float(np.sum(residual**2))
    return (max(0.0, 1.0 - left / whole) if whole > 0.0 else 0.0), coefficients
