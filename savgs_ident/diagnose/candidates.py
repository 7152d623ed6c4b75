"""Hypotheses as a report shows them: with probabilities, parameters and what they gain on tests left out."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnose.engine.climb import Mode, Search
from savgs_ident.diagnose.engine.heldout import HeldOut
from savgs_ident.diagnose.engine.score import Score, cosine
from savgs_ident.diagnose.engine.search import ALIKE, LITTLE, Findings, excess, left_over
from savgs_ident.diagnose.result import Candidate, Confusable, Estimate, NotJudgeable
from savgs_ident.diagnose.verdict import Weighed

WITHIN = 1.959964
"""Standard deviations of a 95 % interval."""

NEARLY = 1e-3
"""Two candidates whose cosine is nearer to 1 are one."""

OFTEN = 10.0
"""An effect that only shows at so many times its typical size cannot be judged."""


def candidates_of(
    findings: Findings,
    weighed: Sequence[Weighed],
    probability: NDArray[np.float64],
    held: Mapping[str, HeldOut],
    search: Search,
) -> tuple[Candidate, ...]:
    """All hypotheses, the most probable first. ``probability`` (n,) is that of each of those weighed."""
    scores = {score.term.name: score for score in findings.scores}
    gap, found = excess(search, findings.base), []
    for each, share in zip(weighed, probability, strict=True):
        sigma = joint_sigma([scores[name] for name in each.effects if name in scores])
        gain = held[each.name].mean - held["none"].mean if each.name in held else float("nan")
        closed = float("nan")
        if each.mode is not None and gap > LITTLE:
            closed = 1.0 - left_over(search, findings.base, each.mode) if each.effects else 0.0
        found.append(
            Candidate(
                name=each.name,
                effects=each.effects,
                probability=float(share),
                score_sigma=sigma,
                heldout_gain=float(gain),
                share_closed=closed,
                parameters=() if each.mode is None else estimates_of(each.mode, scores),
                refitted=each.mode is not None,
            )
        )
    return tuple(found)


def joint_sigma(scores: Sequence[Score]) -> float:
    """Significance of candidates together: what they share counts once. 0 for none of them."""
    if not scores:
        return 0.0
    sigma = np.array([each.sigma for each in scores])
    alike = np.array([[1.0 if one is other else cosine(one, other) for other in scores] for one in scores])
    return max(float(sigma.max()), float(np.sqrt(sigma @ np.linalg.pinv(alike, rcond=NEARLY) @ sigma)))


def estimates_of(mode: Mode, scores: Mapping[str, Score]) -> tuple[Estimate, ...]:
    """The parameters of a hypothesis's terms with their 95 % intervals."""
    return estimates_among(mode, {c.name for name in mode.terms for c in scores[name].term.coordinates})


def estimates_among(mode: Mode, names: Collection[str]) -> tuple[Estimate, ...]:
    """The named parameters of a hypothesis with their 95 % intervals."""
    sd = np.sqrt(np.diag(mode.covariance()))
    found = []
    for each, x, s in zip(mode.coordinates, mode.x.tolist(), sd.tolist(), strict=True):
        if each.name in names:
            low, high = each.value(x - WITHIN * s), each.value(x + WITHIN * s)
            found.append(Estimate(each.name, each.value(x), low, high, each.unit))
    return tuple(found)


def not_judgeable_of(findings: Findings) -> tuple[NotJudgeable, ...]:
    """Effects that this campaign could not have shown at any size that they may have."""
    found = []
    for score in findings.scores:
        amplitude = score.term.amplitudes[0]
        room = max(abs(amplitude.upper - amplitude.centre), abs(amplitude.lower - amplitude.centre))
        if score.smallest > min(room, OFTEN * amplitude.scale / 2.0):
            found.append(NotJudgeable(score.term.name, amplitude.name, float(score.smallest), amplitude.unit))
    return tuple(found)


def confusable_of(findings: Findings) -> tuple[Confusable, ...]:
    """Pairs of effects that look alike in this campaign, the most alike first."""
    found = []
    for place, one in enumerate(findings.scores):
        for other in findings.scores[place + 1 :]:
            alike = abs(cosine(one, other))
            if alike > ALIKE:
                found.append(Confusable((one.term.name, other.term.name), alike))
    return tuple(sorted(found, key=lambda each: -each.cosine))
