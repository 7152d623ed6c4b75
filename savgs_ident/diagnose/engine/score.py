"""Score of a candidate at its null: what it would explain beyond all that the baseline's parameters can.

The candidate's first-order effect on the rows is put beside that of the parameters in the model, whose freedom it
does not get credit for. Two numbers come out: its significance with the weights as they are, and the log evidence
that the linearised hypothesis would have, where noise scale and discrepancy are set to their best anew.
"""

from dataclasses import dataclass
from math import log, sqrt

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnose.engine.climb import Mode, Search
from savgs_ident.diagnose.engine.coordinates import reach_of
from savgs_ident.diagnose.engine.linear import best_of, log_determinant
from savgs_ident.diagnose.engine.prediction import Term


@dataclass(frozen=True)
class Score:
    """A candidate's score.

    Attributes:
        term: the candidate.
        sigma: significance in standard deviations, nuisances projected out.
        evidence: log evidence of the linearised hypothesis.
        start: parameters at its best point, SI, by name.
        column: its effect on the rows per standard deviation of its prior at that choice, (m, amplitudes).
    """

    term: Term
    sigma: float
    evidence: float
    start: dict[str, float]
    column: NDArray[np.float64]


def score_terms(search: Search, mode: Mode, terms: list[Term], choices: tuple[float, ...]) -> list[Score]:
    """Scores of candidates about a mode; ``choices`` are the multiples of their shapes that the plant tries."""
    columns = search.plant.columns(mode.terms, mode.values, mode.prediction.near, terms)
    return [_score(search, mode, term, each, choices) for term, each in zip(terms, columns, strict=True)]


def _score(
    search: Search, mode: Mode, term: Term, columns: NDArray[np.float64], choices: tuple[float, ...]
) -> Score:
    residual = search.residual(mode.prediction)
    count = len(term.amplitudes)
    bounds = tuple(
        np.concatenate(pair) for pair in zip(reach_of(mode.coordinates), reach_of(term.amplitudes), strict=True)
    )
    scales = np.array([each.scale for each in term.amplitudes])
    best: Score | None = None
    for choice, column in zip(choices, columns, strict=True):
        moved = column * scales
        slopes = np.concatenate([mode.slopes, moved], axis=1)
        x = np.concatenate([mode.x, np.zeros(count)])
        top = best_of(search.data, residual, slopes, x, (bounds[0], bounds[1]), search.kept)
        halved = log(2.0) * sum(each.halved for each in mode.coordinates + term.amplitudes)
        evidence = top.value - 0.5 * log_determinant(top.precision) + halved
        if best is None or evidence > best.evidence:
            found = dict(zip((c.name for c in term.amplitudes), top.x[-count:], strict=True))
            start = {each.name: each.value(found[each.name]) for each in term.amplitudes} | {
                each.name: float(np.clip(choice * each.centre, each.lower, each.upper)) for each in term.shapes
            }
            best = Score(term, _significance(search, mode, moved), evidence, start, moved)
    assert best is not None
    return best


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
    drop = score @ np.linalg.solve(information + 1e-12 * size * np.eye(len(score)), score)
    return sqrt(max(float(drop), 0.0))
