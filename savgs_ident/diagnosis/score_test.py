"""Score tests: what an effect would explain beyond the baseline's parameters, and whether a tolerance holds.

The score of an effect is taken at its null. Its first-order change of the rows stands beside that of the parameters
in the model, so that it gets no credit for what these can explain. Two numbers come out: the significance at the
weights of the fit, and the log evidence of the linearised hypothesis, noise scale and discrepancy estimated anew.

A prior conflict are parameters that the data pull further from their sheet than their tolerances allow. A model may
explain everything and still be wrong, if it does so with a spring ten standard deviations off its sheet. The
alternative to all tolerances as they are is that one of them does not hold: its prior is ``broken_tolerance_width``
times as wide. To first order about a fit, with coordinate x ~ N(0, 1) before the data and posterior variance v, the
data alone estimate x / (1 - v) with variance v / (1 - v), from which both evidences follow. Where a further one is
more probable than not beside those that do not hold, it is let go, too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from math import inf, log, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.status import Status
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.inference.laplace import LinearisedOptimum, linearised_optimum, log_evidence, precision_of
from savgs_ident.inference.laplace_fit import LaplaceFit, Search
from savgs_ident.inference.observations import Term
from savgs_ident.inference.prior import Coordinates, EffectCoordinates, Sheet, bounds_of


class Amplitudes(NamedTuple):
    """What the data leave of the amplitudes of a candidate, to first order, on coordinates with unit-normal priors.

    Attributes:
        mean: the coordinates [1] at the best point, (k,).
        covariance: theirs about it [1], (k, k).
        lower: their bounds, (k,).
        upper: the same.
        columns: what a unit of each does to the rows [unit of the row], (m, k).
    """

    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    columns: NDArray[np.float64]

    def draws(self, count: int) -> NDArray[np.float64]:
        """So many changes of the rows [their units], (m, count): normal, held at the bounds."""
        root = np.linalg.cholesky(self.covariance)
        random = np.random.default_rng(0).standard_normal((count, self.mean.size))
        return np.asarray(self.columns @ np.clip(self.mean + random @ root.T, self.lower, self.upper).T)


@dataclass(frozen=True)
class Score:
    """A candidate's score.

    Attributes:
        term: the candidate.
        sigma: significance in standard deviations, nuisances projected out.
        evidence: log evidence of the linearised hypothesis; minus infinity where it was not evaluated.
        start: parameters at its best point, SI, by name.
        smallest: the first amplitude that would stand out of the noise by ``visible_sigma`` sd, nuisances projected
            out [its unit]; infinite if none would.
        direction: what it does to the independent rows there, nuisances projected out, in units of their sd, (m,):
            of unit length, or nothing.
        status: whether what it does to the rows could be evaluated.
        amplitudes: what is left of its amplitudes; None where it was not evaluated.
    """

    term: Term
    sigma: float
    evidence: float
    start: dict[str, float]
    smallest: float
    direction: NDArray[np.float64]
    status: Status = Status.CONVERGED
    amplitudes: Amplitudes | None = None


def score_terms(
    search: Search, mode: LaplaceFit, terms: list[Term], constants: DecisionConstants = DEFAULTS
) -> list[Score]:
    """Scores of candidates about a fit, best first."""
    sensitivities = search.plant.sensitivities(mode.terms, mode.values, mode.prediction.warm_start, terms)
    return scores_of(search, mode, terms, sensitivities, constants)


def scores_of(
    search: Search,
    mode: LaplaceFit,
    terms: Sequence[Term],
    sensitivities: Sequence[NDArray[np.float64]],
    constants: DecisionConstants = DEFAULTS,
) -> list[Score]:
    """The same with known ``sensitivities``, (tries, m, amplitudes) of each term, best first.

    They are in the units of the rows per unit of the amplitude.
    """
    sigma = constants.visible_sigma
    found = [_score(search, mode, term, each, sigma) for term, each in zip(terms, sensitivities, strict=True)]
    return sorted(found, key=lambda each: -each.evidence)


def scores_by_try(
    search: Search, mode: LaplaceFit, term: Term, constants: DecisionConstants = DEFAULTS
) -> list[Score]:
    """Scores of one candidate about a fit, each with its shapes at one of what is tried, best first."""
    return sorted(_in_order_of_tries(search, mode, term, constants), key=lambda each: -each.evidence)


def peaks_by_try(
    search: Search, mode: LaplaceFit, term: Term, constants: DecisionConstants = DEFAULTS
) -> list[Score]:
    """Those of the same that no neighbour among what is tried exceeds: of a resonance, its likely frequencies."""
    found = _in_order_of_tries(search, mode, term, constants)
    evidence = np.array([-np.inf, *(each.evidence for each in found), -np.inf])
    above = evidence[1:-1] >= np.maximum(evidence[:-2], evidence[2:])
    peaks = [each for each, is_peak in zip(found, above, strict=True) if is_peak]
    return sorted(peaks, key=lambda each: -each.evidence)


def _in_order_of_tries(
    search: Search, mode: LaplaceFit, term: Term, constants: DecisionConstants
) -> list[Score]:
    given = mode.values, mode.prediction.warm_start
    (sensitivities,) = search.plant.sensitivities(mode.terms, *given, [term])
    one_each = [replace(term, tries=(shapes,)) for shapes in term.tried]
    both = zip(one_each, sensitivities[:, None], strict=True)
    return [_score(search, mode, each, moved, constants.visible_sigma) for each, moved in both]


def _score(
    search: Search, mode: LaplaceFit, term: Term, sensitivities: NDArray[np.float64], visible: float
) -> Score:
    residual, inside = search.missed(mode.prediction), search.turned(mode.slopes)
    count = len(term.amplitudes)
    lower, upper = bounds_of(term.amplitudes)
    scales = np.array([each.scale for each in term.amplitudes])
    best: Score | None = None
    for shapes, column in zip(term.tried, sensitivities, strict=True):
        if not np.isfinite(column).all():
            continue
        moved = search.turned(column * scales)
        top = _optimum(search, mode, residual, inside, moved, term.amplitudes)
        evidence = log_evidence(top.value, top.precision, mode.coordinates + term.amplitudes)
        if best is None or evidence > best.evidence:
            found = dict(zip((c.name for c in term.amplitudes), top.x[-count:], strict=True))
            start = {each.name: each.value(float(found[each.name])) for each in term.amplitudes} | shapes
            direction = _direction(mode, inside, moved @ _some(top.x[-count:]))
            sigma = _significance(mode, residual, inside, moved)
            smallest = scales[0] * visible * _per_sigma(search.rows.variance, inside, moved[:, 0])
            known = Amplitudes(
                top.x[-count:],
                np.asarray(np.linalg.inv(top.precision)[-count:, -count:], np.float64),
                lower,
                upper,
                column * scales,
            )
            best = Score(term, sigma, evidence, start, smallest, direction, amplitudes=known)
    return best or Score(term, 0.0, -np.inf, {}, np.inf, np.zeros(residual.size), Status.NOT_FINITE)


class PairScore(NamedTuple):
    """Two candidates together: log evidence of the linearised hypothesis, and parameters at its best point, SI."""

    terms: tuple[Term, Term]
    evidence: float
    start: dict[str, float]


def best_pairs(search: Search, mode: LaplaceFit, scores: Sequence[Score], most: int) -> list[PairScore]:
    """The most promising pairs of scored candidates about a fit, at most so many, best first.

    Each candidate is taken where it scores best by itself. All pairs are ranked at the weights of the fit; the noise
    scale and the discrepancy are estimated anew for the first ones alone.
    """
    known = [each for each in scores if each.amplitudes is not None]
    residual, inside = search.missed(mode.prediction), search.turned(mode.slopes)
    moved = [search.turned(each.amplitudes.columns) for each in known if each.amplitudes is not None]

    def scored(one: int, other: int) -> PairScore:
        terms = known[one].term, known[other].term
        added = terms[0].amplitudes + terms[1].amplitudes
        both = np.concatenate([moved[one], moved[other]], axis=1)
        top = _optimum(search, mode, residual, inside, both, added)
        last = top.x[-len(added) :]
        found = {each.name: each.value(float(at)) for each, at in zip(added, last, strict=True)}
        evidence = log_evidence(top.value, top.precision, mode.coordinates + added)
        return PairScore(terms, evidence, known[one].start | known[other].start | found)

    first = _ranked_pairs(mode, residual, inside, moved)[:most]
    return sorted((scored(*pair) for pair in first), key=lambda each: -each.evidence)


SINGULAR = 1e-12
"""Share of the information on two effects at which they are the same one: what double precision resolves."""


def _ranked_pairs(
    mode: LaplaceFit,
    residual: NDArray[np.float64],
    inside: NDArray[np.float64],
    moved: Sequence[NDArray[np.float64]],
) -> list[tuple[int, int]]:
    """Pairs of candidates by their places in ``moved``, the rows of each (m, k), those that explain most first."""
    weight = 1.0 / np.sqrt(mode.noise_scales.spread)
    residual, slopes = residual * weight, inside * weight[:, None]
    ends = np.cumsum([0, *(each.shape[1] for each in moved)]).tolist()
    parts = [list(range(low, high)) for low, high in pairwise(ends)]
    columns = np.concatenate([np.zeros((residual.size, 0)), *moved], axis=1) * weight[:, None]
    cross = columns.T @ slopes
    held = np.linalg.solve(mode.precision, cross.T)
    gradient = columns.T @ residual - held.T @ (slopes.T @ residual - mode.x)
    information = columns.T @ columns - cross @ held + np.eye(ends[-1])

    def promise(pair: tuple[int, int]) -> float:
        both = parts[pair[0]] + parts[pair[1]]
        # In units in which its diagonal is one, so that typical sizes far from the true ones cost no digits.
        unit = 1.0 / np.sqrt(np.diag(information)[both])
        along, axes = np.linalg.eigh(information[np.ix_(both, both)] * np.outer(unit, unit))
        along = np.maximum(along, SINGULAR)
        rise = np.sum((axes.T @ (gradient[both] * unit)) ** 2 / along)
        return 0.5 * float(rise - np.sum(np.log(along)) + 2.0 * np.sum(np.log(unit)))

    return sorted(combinations(range(len(moved)), 2), key=promise, reverse=True)


def _optimum(
    search: Search,
    mode: LaplaceFit,
    residual: NDArray[np.float64],
    inside: NDArray[np.float64],
    moved: NDArray[np.float64],
    added: EffectCoordinates,
) -> LinearisedOptimum:
    """The best point of a fit with ``added`` amplitudes that move its rows by ``moved``, to first order."""
    lower, upper = (
        np.concatenate(pair) for pair in zip(bounds_of(mode.coordinates), bounds_of(added), strict=True)
    )
    slopes, x = np.concatenate([inside, moved], axis=1), np.concatenate([mode.x, np.zeros(len(added))])
    return linearised_optimum(search.rows, residual, slopes, x, (lower, upper), scales=mode.noise_scales)


def cosine(one: Score, other: Score) -> float:
    """The cosine between what two candidates do, -1 to 1."""
    return float(one.direction @ other.direction)


def _some(amplitudes: NDArray[np.float64]) -> NDArray[np.float64]:
    """The amplitudes, or a unit of each where all vanish."""
    return amplitudes if np.any(amplitudes) else np.ones_like(amplitudes)


def _direction(
    mode: LaplaceFit, inside: NDArray[np.float64], moved: NDArray[np.float64]
) -> NDArray[np.float64]:
    weight = 1.0 / np.sqrt(mode.noise_scales.spread)
    weighed, left = inside * weight[:, None], moved * weight
    left = left - weighed @ np.linalg.solve(mode.precision, weighed.T @ left)
    length = float(np.linalg.norm(left))
    return left / length if length > 0.0 else left


def _per_sigma(noise: NDArray[np.float64], inside: NDArray[np.float64], column: NDArray[np.float64]) -> float:
    """How many units of a column stand out of the noise by one standard deviation; infinite if none do."""
    precision = precision_of(inside, noise)
    cross = inside.T @ (column / noise)
    whole = float(column @ (column / noise))
    visible = whole - float(cross @ np.linalg.solve(precision, cross))
    return 1.0 / sqrt(visible) if visible > 1e-9 * whole > 0.0 else np.inf


def _significance(
    mode: LaplaceFit,
    residual: NDArray[np.float64],
    inside: NDArray[np.float64],
    moved: NDArray[np.float64],
) -> float:
    """Square root of the drop of chi2 that the candidate brings, at the weights of the mode."""
    spread = mode.noise_scales.spread
    weighted = moved / spread[:, None]
    cross = inside.T @ weighted
    held = np.linalg.solve(mode.precision, cross)
    score = weighted.T @ residual - held.T @ (inside.T @ (residual / spread) - mode.x)
    information = weighted.T @ moved - cross.T @ held
    size = np.trace(information) / len(information)
    if size <= 0.0:
        return 0.0
    drop = score @ np.linalg.solve(information + 1e-10 * size * np.eye(len(score)), score)
    return sqrt(max(float(drop), 0.0))


class PriorConflict(NamedTuple):
    """What speaks for tolerances that do not hold.

    Attributes:
        gain: rise of the log evidence of a fit if one of the tolerances may not hold, each with equal probability,
            and with it those that are more probable than not; these with their prior.
        off: how many tolerances (standard deviations) a parameter is off its sheet, by name: the one whose tolerance
            gains most first. Empty where none is known to a tolerance.
    """

    gain: float
    off: Mapping[str, float]


def prior_conflict(
    mode: LaplaceFit, nuisances: Coordinates, constants: DecisionConstants = DEFAULTS
) -> PriorConflict:
    """The conflict of a fit with the tolerances of its ``nuisances``."""
    known = {each.name for each in nuisances if isinstance(each, Sheet) and each.known}
    left = [k for k, each in enumerate(mode.coordinates) if each.name in known]
    x, precision, width = mode.x, mode.precision, constants.broken_tolerance_width
    total, off = -inf, list[int]()
    while left:
        variance = np.diag(np.linalg.inv(precision))
        gains = [_gain(float(x[k]), float(variance[k]), width) for k in left]
        gain = float(np.logaddexp.reduce(gains)) - log(len(left))
        if off:
            gain += log(constants.prior_broken_tolerance)
            if gain <= 0.0:
                break
        best = left.pop(int(np.argmax(gains)))
        x, precision = _let_go(x, precision, best, width)
        total, off = gain if not off else total + gain, [*off, best]
    return PriorConflict(total, {mode.coordinates[k].name: float(x[k]) for k in off})


def _let_go(
    x: NDArray[np.float64], precision: NDArray[np.float64], one: int, width: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A mode (n,) [1] and its precision (n, n), to first order, with ``width`` in place of 1 as the prior of one."""
    given = 1.0 - 1.0 / width**2
    less = precision.copy()
    less[one, one] -= given
    return x + np.linalg.solve(less, given * x[one] * np.eye(x.size)[one]), less


def _gain(x: float, variance: float, width: float) -> float:
    """Rise of the log evidence by a prior of ``width`` in place of 1, from mode and posterior variance below 1."""
    information = 1.0 - variance
    if information <= 0.0:
        return 0.0
    estimate, spread = x / information, variance / information
    narrow, wide = spread + 1.0, spread + width**2
    return 0.5 * (estimate**2 * (1.0 / narrow - 1.0 / wide) + log(narrow / wide))
