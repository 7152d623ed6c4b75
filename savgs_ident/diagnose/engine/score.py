"""Score of a candidate at its null: what it would explain beyond all that the baseline's parameters can.

The candidate's first-order effect on the rows is put beside that of the parameters in the model, whose freedom it
does not get credit for. Two numbers come out: its significance with the weights as they are, and the log evidence
that the linearised hypothesis would have, where noise scale and discrepancy are set to their best anew.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log, sqrt

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnose.engine.climb import Mode, Search
from savgs_ident.diagnose.engine.coordinates import reach_of
from savgs_ident.diagnose.engine.linear import best_of, log_determinant
from savgs_ident.diagnose.engine.prediction import Term

STANDS_OUT = 5.0
"""Standard deviations by which an effect must change the response to be seen."""


@dataclass(frozen=True)
class Score:
    """A candidate's score.

    Attributes:
        term: the candidate.
        sigma: significance in standard deviations, nuisances projected out.
        evidence: log evidence of the linearised hypothesis; minus infinity where what it does is not known.
        start: parameters at its best point, SI, by name.
        smallest: the first amplitude that would stand out of the noise by :data:`STANDS_OUT` sd, nuisances projected
            out [its unit]; infinite if none would.
        direction: what it does to the rows there, nuisances projected out, in units of their sd, (m,): of unit
            length, or nothing.
    """

    term: Term
    sigma: float
    evidence: float
    start: dict[str, float]
    smallest: float
    direction: NDArray[np.float64]


def score_terms(search: Search, mode: Mode, terms: list[Term]) -> list[Score]:
    """Scores of candidates about a mode, best first."""
    columns = search.plant.columns(mode.terms, mode.values, mode.prediction.near, terms)
    return scores_of(search, mode, terms, columns)


def scores_of(
    search: Search, mode: Mode, terms: Sequence[Term], columns: Sequence[NDArray[np.float64]]
) -> list[Score]:
    """The same with known ``columns``, (tries, m, amplitudes) of each term, best first.

    Columns are in the units of the rows per unit of the amplitude.
    """
    found = [_score(search, mode, term, each) for term, each in zip(terms, columns, strict=True)]
    return sorted(found, key=lambda each: -each.evidence)


def _score(search: Search, mode: Mode, term: Term, columns: NDArray[np.float64]) -> Score:
    residual = search.residual(mode.prediction)
    count = len(term.amplitudes)
    bounds = tuple(
        np.concatenate(pair)
        for pair in zip(reach_of(mode.coordinates), reach_of(term.amplitudes), strict=True)
    )
    scales = np.array([each.scale for each in term.amplitudes])
    best: Score | None = None
    for shapes, column in zip(term.tried, columns, strict=True):
        if not np.isfinite(column).all():
            continue
        moved = column * scales
        slopes = np.concatenate([mode.slopes, moved], axis=1)
        x = np.concatenate([mode.x, np.zeros(count)])
        top = best_of(search.data, residual, slopes, x, (bounds[0], bounds[1]), search.kept)
        halved = log(2.0) * sum(each.halved for each in mode.coordinates + term.amplitudes)
        evidence = top.value - 0.5 * log_determinant(top.precision) + halved
        if best is None or evidence > best.evidence:
            found = dict(zip((c.name for c in term.amplitudes), top.x[-count:], strict=True))
            start = {each.name: each.value(float(found[each.name])) for each in term.amplitudes} | shapes
            direction = _direction(search, mode, moved @ _some(top.x[-count:]))
            sigma, smallest = (
                _significance(search, mode, moved),
                scales[0] * _smallest(search, mode, moved[:, 0]),
            )
            best = Score(term, sigma, evidence, start, smallest, direction)
    return best or Score(term, 0.0, -np.inf, {}, np.inf, np.zeros(residual.size))


def cosine(one: Score, other: Score) -> float:
    """The cosine between what two candidates do, -1 to 1."""
    return float(one.direction @ other.direction)


def _some(amplitudes: NDArray[np.float64]) -> NDArray[np.float64]:
    """The amplitudes, or a unit of each where all vanish."""
    return amplitudes if np.any(amplitudes) else np.ones_like(amplitudes)


def _direction(search: Search, mode: Mode, moved: NDArray[np.float64]) -> NDArray[np.float64]:
    weight = np.zeros(moved.size)
    weight[search.kept] = 1.0 / np.sqrt(mode.misfit.spread)
    inside = mode.slopes * weight[:, None]
    left = moved * weight
    left = left - inside @ np.linalg.solve(mode.precision, inside.T @ left)
    length = float(np.linalg.norm(left))
    return left / length if length > 0.0 else left


def _smallest(search: Search, mode: Mode, moved: NDArray[np.float64]) -> float:
    """How many units of a column stand out of the noise."""
    kept, noise = search.kept, search.data.variance[search.kept]
    inside, column = mode.slopes[kept], moved[kept]
    precision = np.eye(mode.x.size) + (inside.T / noise) @ inside
    cross = inside.T @ (column / noise)
    visible = float(column @ (column / noise) - cross @ np.linalg.solve(precision, cross))
    whole = float(column @ (column / noise))
    return STANDS_OUT / sqrt(visible) if visible > 1e-9 * whole > 0.0 else np.inf


def _significance(search: Search, mode: Mode, moved: NDArray[np.float64]) -> float:
    """Square root of the drop of chi2 that the candidate brings, at the weights of the mode."""
    kept, spread = search.kept, mode.misfit.spread
    residual = search.residual(mode.prediction)[kept]
    weighted = moved[kept] / spread[:, None]
    inside = mode.slopes[kept]
    cross = inside.T @ weighted
    held = np.linalg.solve(mode.precision, cross)
    score = weighted.T @ residual - held.T @ (inside.T @ (residual / spread) - mode.x)
    information = weighted.T @ moved[kept] - cross.T @ held
    size = np.trace(information) / len(information)
    if size <= 0.0:
        return 0.0
    drop = score @ np.linalg.solve(information + 1e-10 * size * np.eye(len(score)), score)
    return sqrt(max(float(drop), 0.0))
