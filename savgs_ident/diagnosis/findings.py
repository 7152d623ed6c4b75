"""What a search for what is missing has tried, and what its fits leave of the misfit."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from savgs_ident.core.status import Status
from savgs_ident.diagnosis.result import Hypothesis
from savgs_ident.diagnosis.score_test import Score
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.inference.laplace_fit import LaplaceFit, Search


class LostHypothesis(NamedTuple):
    """A hypothesis that was not evaluated, and how the solution of the plant ended."""

    hypothesis: Hypothesis
    status: Status


@dataclass(frozen=True)
class Findings:
    """All hypotheses that were tried.

    Attributes:
        base: the baseline, recalibrated.
        scores: scores of all effects at the baseline, best first.
        modes: hypotheses that were fitted in full, the best first; the baseline is not among them.
        lost: hypotheses whose fit found no solution of the plant, and how that ended.
    """

    base: LaplaceFit
    scores: tuple[Score, ...]
    modes: tuple[LaplaceFit, ...]
    lost: tuple[LostHypothesis, ...] = ()


def hypothesis_of(mode: LaplaceFit) -> Hypothesis:
    """What a fit assumes to be missing."""
    return Hypothesis(mode.terms)


def excess(search: Search, mode: LaplaceFit) -> float:
    """The misfit [1]: mean square of the residuals in their variances, less one, and not below zero.

    The variance is that of the noise, and of errors that rows share at the size that these are expected at.
    """
    rows = search.rows
    expected = rows.scales.discrepancy if search.data.shared is not None else 0.0
    variance = rows.marginal(1.0, expected)
    return max(float(np.mean(search.missed(mode.prediction) ** 2 / variance)) - 1.0, 0.0)


def left_over(
    search: Search, base: LaplaceFit, mode: LaplaceFit, constants: DecisionConstants = DEFAULTS
) -> float:
    """Share of the baseline's misfit that a hypothesis leaves; 0 where that is hardly more than the noise.

    Infinite where the baseline left nothing.
    """
    left, whole = excess(search, mode), excess(search, base)
    if left <= constants.negligible_misfit:
        return 0.0
    return left / whole if whole > 0.0 else np.inf


def to_be_gained(search: Search, mode: LaplaceFit) -> float:
    """By how much the log density of one that leaves nothing but the noise would be greater [nat], if at all."""
    return max(-0.5 * search.rows.measured.size - mode.noise_scales.value, 0.0)


def explains_all(
    search: Search, base: LaplaceFit, mode: LaplaceFit, constants: DecisionConstants = DEFAULTS
) -> bool:
    """Whether a hypothesis leaves next to nothing of the baseline's misfit, and next to no log density to be gained.

    A formula that only resembles the right one may leave less of the misfit than its noise, spread over all rows, and
    yet be much less probable than the right one is.
    """
    little = left_over(search, base, mode, constants) <= constants.explained_share
    return little and to_be_gained(search, mode) <= constants.negligible_gain * search.rows.measured.size
