"""Hypotheses as a report shows them: with probabilities, parameters and what they gain on tests left out."""

from collections.abc import Callable, Collection, Mapping, Sequence
from math import nan, sqrt

import numpy as np

from savgs_ident.diagnosis.findings import Findings, excess, left_over
from savgs_ident.diagnosis.held_out import HeldOut
from savgs_ident.diagnosis.result import (
    NONE,
    Candidate,
    Confusable,
    Estimate,
    Hypothesis,
    NotJudgeable,
    PortFamily,
)
from savgs_ident.diagnosis.score_test import Score, cosine
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.diagnosis.verdict import WeighedHypothesis, probabilities
from savgs_ident.inference.laplace_fit import LaplaceFit, Search

WITHIN = 1.959964
"""Standard deviations of a 95 % interval."""


def candidates_of(
    findings: Findings,
    weighed: Sequence[WeighedHypothesis],
    held: Mapping[Hypothesis, HeldOut],
    search: Search,
    kinds: Callable[[Hypothesis], tuple[PortFamily, ...]],
    constants: DecisionConstants = DEFAULTS,
) -> tuple[Candidate, ...]:
    """All hypotheses, the most probable first, with what they predict of tests left out where that was ``held``.

    ``kinds`` says where a hypothesis acts and of which kind it is.
    """
    scores = {score.term.name: score for score in findings.scores}
    gap, found = excess(search, findings.base), []
    for each, share in zip(weighed, probabilities(weighed), strict=True):
        hypothesis, mode = each.hypothesis, each.mode
        gain = held[hypothesis].mean - held[NONE].mean if hypothesis in held else nan
        beyond = held[hypothesis].beyond - held[NONE].beyond if hypothesis in held else nan
        closed = nan
        if mode is not None and gap > constants.negligible_misfit:
            left = left_over(search, findings.base, mode, constants)
            closed = 1.0 - left if hypothesis.effects or hypothesis.flexible else 0.0
        there = kinds(hypothesis)
        found.append(
            Candidate(
                hypothesis=hypothesis,
                probability=float(share),
                score_sigma=joint_sigma(
                    [scores[name] for name in hypothesis.effects if name in scores], constants
                ),
                heldout_gain=float(gain),
                gain_beyond=float(beyond),
                share_closed=closed,
                parameters=() if mode is None or hypothesis.flexible else estimates_of(search, mode, scores),
                refitted=mode is not None,
                ports=tuple(dict.fromkeys(each.port for each in there)),
                families=tuple(dict.fromkeys(each.family.value for each in there)),
            )
        )
    return tuple(found)


def joint_sigma(scores: Sequence[Score], constants: DecisionConstants = DEFAULTS) -> float:
    """Significance of candidates together: what they share counts once. 0 for none of them."""
    if not scores:
        return 0.0
    sigma = np.array([each.sigma for each in scores])
    alike = np.array([[1.0 if one is other else cosine(one, other) for other in scores] for one in scores])
    independent = np.linalg.pinv(alike, rcond=constants.cosine_resolution)
    # Of opposite effects nothing but a rounding is left of the square, on either side of zero.
    return max(float(sigma.max()), sqrt(max(float(sigma @ independent @ sigma), 0.0)))


def estimates_of(search: Search, mode: LaplaceFit, scores: Mapping[str, Score]) -> tuple[Estimate, ...]:
    """The parameters of a hypothesis's terms with their 95 % intervals."""
    return estimates_among(
        search, mode, {c.name for name in mode.terms for c in scores[name].term.coordinates}
    )


def estimates_among(search: Search, mode: LaplaceFit, names: Collection[str]) -> tuple[Estimate, ...]:
    """The named parameters of a hypothesis with their 95 % intervals."""
    sd = np.sqrt(np.diag(search.covariance(mode)))
    found = []
    for each, x, s in zip(mode.coordinates, mode.x.tolist(), sd.tolist(), strict=True):
        if each.name in names:
            low, high = each.value(x - WITHIN * s), each.value(x + WITHIN * s)
            found.append(Estimate(each.name, each.value(x), low, high, each.unit))
    return tuple(found)


BEYOND_REASON = 1e3
"""So many typical sizes of an effect are no size that it could have. Origin: by choice."""


def not_judgeable_of(findings: Findings, constants: DecisionConstants = DEFAULTS) -> tuple[NotJudgeable, ...]:
    """Effects that this campaign could not have shown at any size that they may have."""
    found = []
    for score in findings.scores:
        amplitude = score.term.amplitudes[0]
        room = max(abs(amplitude.upper - amplitude.centre), abs(amplitude.lower - amplitude.centre))
        typical = amplitude.scale / constants.amplitude_width
        if score.smallest > min(room, constants.assessable_sizes * typical):
            possible = score.smallest <= min(room, BEYOND_REASON * typical)
            smallest = float(score.smallest) if possible else np.inf
            found.append(NotJudgeable(score.term.name, amplitude.name, smallest, amplitude.unit))
    return tuple(found)


def confusable_of(findings: Findings, constants: DecisionConstants = DEFAULTS) -> tuple[Confusable, ...]:
    """Pairs of effects that look alike in this campaign, the most alike first."""
    found = []
    for index, one in enumerate(findings.scores):
        for other in findings.scores[index + 1 :]:
            alike = abs(cosine(one, other))
            if alike > constants.lookalike_cosine:
                found.append(Confusable((one.term.name, other.term.name), alike))
    return tuple(sorted(found, key=lambda each: -each.cosine))
