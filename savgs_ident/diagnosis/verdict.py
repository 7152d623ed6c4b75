"""From fitted hypotheses to a verdict: log weights, probabilities, and what may be said.

The log weight of a hypothesis is its log evidence plus the log of its prior probability. All hypotheses together have
probability one:

    none        the recalibrated baseline
    one effect  fitted in full, or by its score where that promised too little for a fit
    two effects fitted in full
    unknown     a law learned at a port, alone or beside the best effects, or tolerances that do not hold

What the most probable effects are with tolerances that do not hold beside them says the same of effects: both count.

Something is missing where the best fitted hypothesis, or *unknown*, has log odds against *none* beyond the threshold
of an alarm, and where it changes the response by enough to matter.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import log, pi, sqrt
from types import MappingProxyType
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnosis.findings import Findings, hypothesis_of
from savgs_ident.diagnosis.result import NONE, UNKNOWN, Hypothesis, Kind
from savgs_ident.diagnosis.score_test import PriorConflict
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.inference.laplace_fit import LaplaceFit


@dataclass(frozen=True)
class WeighedHypothesis:
    """A hypothesis with its log weight, evidence and prior, and how well that is known.

    ``mode`` is its fit, None where it was only scored; ``sd`` the standard deviation of the weight [nat].
    """

    hypothesis: Hypothesis
    weight: float
    mode: LaplaceFit | None
    sd: float = 0.0


class Change(NamedTuple):
    """A change of the response, as a share of it [1]: of all tests together, and of the test where it is greatest."""

    overall: float
    in_one_test: float

    def matters(self, constants: DecisionConstants = DEFAULTS) -> bool:
        """Whether it is large enough to be called an effect."""
        local = self.in_one_test >= constants.material_share_of_test
        return self.overall >= constants.material_share or local


Reason = Literal["law", "law beside effects", "tolerance"]
"""What speaks for something unknown: a law at a port, alone or beside effects, or tolerances that do not hold."""


class UnknownEvidence(NamedTuple):
    """What speaks most for something that the catalogue does not have: its log weight, and which reason it is."""

    weight: float
    reason: Reason

    @property
    def is_tolerance(self) -> bool:
        """Whether it is numbers of the data sheet that do not hold."""
        return self.reason == "tolerance"


class BrokenTolerance(NamedTuple):
    """Tolerances that do not hold.

    Attributes:
        weight: log weight, prior included.
        conflict: which parameters are how far off their sheet.
        beside: the hypothesis that is assumed besides.
        ports: the locations at which these parameters act, each once; of those that no port has (hardpoints) none.
    """

    weight: float
    conflict: PriorConflict
    beside: Hypothesis
    ports: tuple[str, ...]

    def is_likely(self, constants: DecisionConstants = DEFAULTS) -> bool:
        """Whether beside this hypothesis they are more probable than tolerances that hold."""
        return self.conflict.gain + log(constants.prior_broken_tolerance) > 0.0


def log_prior(hypothesis: Hypothesis, count: int, constants: DecisionConstants = DEFAULTS) -> float:
    """Log prior probability of a hypothesis, where the catalogue has ``count`` effects that may be missing."""
    if hypothesis.unknown or hypothesis.flexible:
        return log(constants.prior_unknown)
    if not hypothesis.effects:
        return log(constants.prior_none)
    if len(hypothesis.effects) == 1:
        return log(constants.prior_single / max(count, 1))
    return log_prior_of_pair(count, constants)


def log_prior_of_pair(count: int, constants: DecisionConstants = DEFAULTS) -> float:
    """Log prior probability that two certain ones of ``count`` effects are missing."""
    return log(constants.prior_pair / max(count * (count - 1) / 2, 1))


def most_probable(findings: Findings, constants: DecisionConstants = DEFAULTS) -> LaplaceFit:
    """The fitted hypothesis with the greatest weight, evidence and prior."""
    count = len(findings.scores)
    return max(
        (findings.base, *findings.modes),
        key=lambda mode: mode.evidence + log_prior(hypothesis_of(mode), count, constants),
    )


def without_immaterial_members(
    findings: Findings,
    change: Callable[[LaplaceFit, Sequence[str]], Change],
    without: Callable[[LaplaceFit, Sequence[str]], LaplaceFit],
    constants: DecisionConstants = DEFAULTS,
) -> Findings:
    """The findings less the most probable ones that need an effect which does too little to matter.

    What a wrong effect leaves, a trace of a second one often takes away: that does not make both of them right.
    ``change`` is what some terms of a hypothesis do to the response; ``without`` fits it without some, from where it
    is: what matters may have been found beside the trace alone.
    """
    best = most_probable(findings, constants)
    while len(best.terms) > 1:
        gone = [name for name in best.terms if not change(best, (name,)).matters(constants)]
        if not gone:
            break
        modes = [each for each in findings.modes if each is not best]
        if len(gone) < len(best.terms):
            modes = _with_better(modes, without(best, gone))
        findings = replace(findings, modes=tuple(modes))
        best = most_probable(findings, constants)
    return findings


def _with_better(modes: Sequence[LaplaceFit], found: LaplaceFit) -> list[LaplaceFit]:
    """The fits, best first, with another one where it is the best of its hypothesis."""
    others = [each for each in modes if hypothesis_of(each) != hypothesis_of(found)]
    least = max(
        (each.evidence for each in modes if hypothesis_of(each) == hypothesis_of(found)), default=-np.inf
    )
    if not found.solved or found.evidence <= least:
        return list(modes)
    return sorted([*others, found], key=lambda each: -each.evidence)


def broken_tolerance(
    mode: LaplaceFit,
    conflict: PriorConflict,
    count: int,
    ports: Mapping[str, str],
    constants: DecisionConstants = DEFAULTS,
) -> BrokenTolerance:
    """The tolerances that do not hold beside a fit, where the catalogue has ``count`` effects that may be missing.

    ``ports`` are the locations at which parameters act, by name; hardpoints act at none.
    """
    beside = hypothesis_of(mode)
    prior = log_prior(beside, count, constants) + log(constants.prior_broken_tolerance)
    places = tuple(dict.fromkeys(ports[name] for name in conflict.off if name in ports))
    return BrokenTolerance(mode.evidence + conflict.gain + prior, conflict, beside, places)


def unknown_evidence(
    findings: Findings,
    alone: float,
    beside: float,
    broken: BrokenTolerance | None,
    constants: DecisionConstants = DEFAULTS,
) -> UnknownEvidence:
    """What speaks most for something unknown.

    ``alone`` is the log evidence of a law learned at some port, ``beside`` that of one beside the most probable
    hypothesis, whose prior it shares; ``broken`` are the tolerances that do not hold where nothing else is missing,
    None where an effect of the catalogue is that.
    """
    prior = log_prior(hypothesis_of(most_probable(findings, constants)), len(findings.scores), constants)
    unknown = log_prior(UNKNOWN, len(findings.scores), constants)
    found = [
        UnknownEvidence(alone + unknown, "law"),
        UnknownEvidence(beside + unknown + prior, "law beside effects"),
    ]
    if broken is not None:
        found.append(UnknownEvidence(broken.weight, "tolerance"))
    return max(found, key=lambda each: each.weight)


def weigh(
    findings: Findings,
    unknown: UnknownEvidence,
    constants: DecisionConstants = DEFAULTS,
    as_tolerance: Mapping[Hypothesis, Sequence[float]] = MappingProxyType({}),
) -> tuple[WeighedHypothesis, ...]:
    """All hypotheses by falling weight, but for those whose fit was lost.

    ``as_tolerance`` has log weights of hypotheses as, or with, tolerances that do not hold: all count.
    """
    count = len(findings.scores)

    def weighed(hypothesis: Hypothesis, evidence: float, mode: LaplaceFit | None) -> WeighedHypothesis:
        weight = evidence + log_prior(hypothesis, count, constants)
        every = float(np.logaddexp.reduce([weight, *as_tolerance.get(hypothesis, ())]))
        return WeighedHypothesis(hypothesis, every, mode)

    fits = [(hypothesis_of(mode), mode) for mode in findings.modes]
    decided = {*(hypothesis for hypothesis, _ in fits), *(each.hypothesis for each in findings.lost)}
    scored = [(Hypothesis((score.term.name,)), score.evidence) for score in findings.scores]
    return _by_weight(
        [
            weighed(NONE, findings.base.evidence, findings.base),
            WeighedHypothesis(UNKNOWN, unknown.weight, None),
            *(weighed(hypothesis, mode.evidence, mode) for hypothesis, mode in fits),
            *(weighed(each, evidence, None) for each, evidence in scored if each not in decided),
        ]
    )


def _by_weight(weighed: Sequence[WeighedHypothesis]) -> tuple[WeighedHypothesis, ...]:
    return tuple(sorted(weighed, key=lambda each: -each.weight))


DRAWS = 4000
"""Draws of uncertain weights over which probabilities are averaged: to a hundredth."""


def probabilities(weighed: Sequence[WeighedHypothesis]) -> NDArray[np.float64]:
    """Their probabilities, (n,), which sum to 1: averaged over what their weights may be."""
    weights, sd = np.array([each.weight for each in weighed]), np.array([each.sd for each in weighed])
    drawn = weights
    if np.any(sd):
        drawn = weights + sd * np.random.default_rng(0).standard_normal((DRAWS, sd.size))
    shares = np.exp(drawn - drawn.max(axis=-1, keepdims=True))
    each = shares / shares.sum(axis=-1, keepdims=True)
    # A mean of ones may be one and a rounding.
    return np.asarray(np.minimum(each.reshape(-1, weights.size).mean(axis=0), 1.0))


def uncertain_odds(odds: float, sd: float) -> float:
    """Log odds [nat] of what is known with log odds that have a standard deviation ``sd`` [nat].

    Source: the logistic function averaged over a normal density, MacKay 1992, Neural Computation 4(5).
    """
    return odds / sqrt(1.0 + pi * sd**2 / 8.0)


def alarm_odds(weighed: Sequence[WeighedHypothesis]) -> float:
    """Log odds that something is missing, the best fitted hypothesis or an unknown one, against nothing."""
    missing = [
        each.weight
        for each in weighed
        if each.hypothesis.unknown or (each.hypothesis.effects and each.mode is not None)
    ]
    return max(missing) - next(each.weight for each in weighed if each.hypothesis == NONE)


def decide(
    weighed: Sequence[WeighedHypothesis],
    change: Change,
    left: float,
    constants: DecisionConstants = DEFAULTS,
    unknown_by: Reason = "law",
) -> tuple[Kind, WeighedHypothesis]:
    """What may be said, and the hypothesis that it rests on.

    ``change`` is what the best fitted hypothesis does to the response; ``left`` the share of the baseline's misfit
    that it leaves; ``unknown_by`` what speaks for something unknown. What leaves next to nothing is named though
    something unknown may explain the rest as well; but not where that is a tolerance which does not hold in the
    baseline as it is: then it is known what is off, and that it is more probable.
    """
    none, unknown = (
        next(each for each in weighed if each.hypothesis == hypothesis) for hypothesis in (NONE, UNKNOWN)
    )
    fitted = [each for each in weighed if each.mode is not None and each.hypothesis.effects]
    best = fitted[0] if fitted else none
    if alarm_odds(weighed) < constants.alarm_log_odds:
        return "none", none
    explains = best.weight >= none.weight + constants.alarm_log_odds and left <= constants.explained_share
    named = explains and change.matters(constants) and unknown_by != "tolerance"
    if unknown.weight > best.weight and not named:
        return "unknown", unknown
    if not change.matters(constants):
        return "none", none
    if left > constants.unexplained_share:
        return "unknown", unknown
    return ("effect" if len(best.hypothesis.effects) == 1 else "several"), best


def indistinguishable(
    weighed: Sequence[WeighedHypothesis],
    chosen: WeighedHypothesis,
    constants: DecisionConstants = DEFAULTS,
) -> tuple[str, ...]:
    """Effects that the campaign cannot distinguish from those of the chosen hypothesis, in place of one of them.

    A hypothesis that is much less probable by its prior alone is one of them: the campaign does not speak against it.
    """
    mine = chosen.hypothesis.effects
    near = [
        each.hypothesis.effects
        for each in weighed
        if len(each.hypothesis.effects) == len(mine)
        and (
            each.weight > chosen.weight - constants.indistinguishable_log_odds
            or _fits_as_well(each, chosen, constants)
        )
    ]
    others = (tuple(name for name in effects if name not in mine) for effects in near)
    return tuple(dict.fromkeys(names[0] for names in others if len(names) == 1))


def _fits_as_well(each: WeighedHypothesis, chosen: WeighedHypothesis, constants: DecisionConstants) -> bool:
    """Whether the data alone, without the priors, do not distinguish a hypothesis from the chosen one."""
    if each.mode is None or chosen.mode is None:
        return False
    return (
        each.mode.noise_scales.value > chosen.mode.noise_scales.value - constants.indistinguishable_log_odds
    )
