"""From hypotheses to a verdict: probabilities, and what may be said."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import log
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnose.engine.climb import Mode
from savgs_ident.diagnose.engine.search import Findings
from savgs_ident.diagnose.engine.strain import Strain
from savgs_ident.diagnose.result import Kind

PRIOR_NONE = 0.4
PRIOR_SINGLE = 0.4
PRIOR_PAIR = 0.1
PRIOR_UNKNOWN = 0.1
"""Prior probabilities that nothing is missing, one effect, two, or something that the catalogue does not have."""

PRIOR_STRAINED = 0.01
"""Prior probability that, beside what a hypothesis says, one of the sheet's tolerances does not hold."""

SURE = 4.0
"""Log odds against the baseline from which on something is said to be missing.

Where nothing is missing, and priors and noise are what they are taken for, such odds or higher ones arise in at most
exp(-4) = 1.8 % of all campaigns (Markov's inequality).
"""

MATERIAL = 0.003
"""Change of the response by an effect, as a share of it, below which it does not matter, unless it does somewhere."""

LOCAL = 0.02
"""The same in the one test where it does most."""

TRACE = 0.0004
"""Change of the response by a learned law, as a share of it, below which it is a trace, unless it reaches LOCAL.

Two formulations of the same rig differ by up to 0.03 %.
"""

LEFT = 0.05
"""Share of the baseline's excess misfit that named effects may leave; beyond it something else is missing."""

LEFT_BY_ANOTHER_LAW = 0.1
"""The same of one effect whose law is another than the catalogue's, if what it leaves sits at its own port."""

CONFUSED = 5.0
"""Log odds within which two hypotheses cannot be told apart, nor two ports."""


@dataclass(frozen=True)
class Weighed:
    """A hypothesis with its log weight: evidence and prior.

    ``name`` is "none", "unknown" or the effects joined by " + "; ``mode`` is missing where it was only scored.
    """

    name: str
    effects: tuple[str, ...]
    weight: float
    mode: Mode | None


class Change(NamedTuple):
    """What something does to the response, as a share of it: in all, and in the test where it does most."""

    whole: float
    somewhere: float

    @property
    def matters(self) -> bool:
        """Whether it is large enough to be called an effect."""
        return self.whole >= MATERIAL or self.somewhere >= LOCAL

    @property
    def is_trace(self) -> bool:
        """Whether it is too small for a law that does no more to speak for something unknown."""
        return self.whole < TRACE and self.somewhere < LOCAL


Reason = Literal["law", "besides", "strain"]
"""What speaks for something unknown: a law at a port, one besides the best effects, a tolerance that is broken."""


class Unknown(NamedTuple):
    """What speaks most for something that the catalogue does not have: log weight, prior included, and why."""

    weight: float
    reason: Reason


def prior_of(terms: Sequence[str], count: int) -> float:
    """Log prior of a hypothesis of so many terms out of ``count``."""
    if not terms:
        return log(PRIOR_NONE)
    singles, pairs = max(count, 1), max(count * (count - 1) / 2, 1)
    return log(PRIOR_SINGLE / singles) if len(terms) == 1 else log(PRIOR_PAIR / pairs)


def heaviest(findings: Findings) -> Mode:
    """The fitted hypothesis with the greatest weight, evidence and prior."""
    count = len(findings.scores)
    return max((findings.base, *findings.modes), key=lambda mode: mode.evidence + prior_of(mode.terms, count))


def of_material_parts(findings: Findings, change: Callable[[Mode, Sequence[str]], Change]) -> Findings:
    """The findings less the heaviest ones that need an effect which does too little to matter.

    What a wrong effect leaves, a trace of a second one often takes away: that does not make both of them right.
    ``change`` is what some terms of a hypothesis do to the response.
    """
    best = heaviest(findings)
    while len(best.terms) > 1 and any(not change(best, (name,)).matters for name in best.terms):
        findings = replace(findings, modes=tuple(each for each in findings.modes if each is not best))
        best = heaviest(findings)
    return findings


class Strained(NamedTuple):
    """A tolerance that does not hold: log weight, prior included, the strain, and the effects ``beside`` it."""

    weight: float
    strain: Strain
    beside: tuple[str, ...]


def most_strained(findings: Findings, strain: Callable[[Mode], Strain]) -> Strained:
    """The broken tolerance that is most probable.

    Beside the heaviest hypothesis; where this is a pair also beside nothing, for one broken tolerance is simpler than
    two effects.
    """

    def broken(mode: Mode) -> Strained:
        found, prior = strain(mode), prior_of(mode.terms, len(findings.scores)) + log(PRIOR_STRAINED)
        return Strained(mode.evidence + found.gain + prior, found, mode.terms)

    best = heaviest(findings)
    modes = (best, findings.base) if len(best.terms) > 1 else (best,)
    return max(map(broken, modes), key=lambda each: each.weight)


def unknown_of(findings: Findings, alone: float, besides: float, strained: float) -> Unknown:
    """What speaks most for something unknown.

    ``alone`` is the log evidence of a law learned at some port, ``besides`` that of one beside the heaviest
    hypothesis, which is less probable beforehand than it; ``strained`` is the log weight of a broken tolerance.
    """
    prior = prior_of(heaviest(findings).terms, len(findings.scores))
    found = (
        Unknown(alone + log(PRIOR_UNKNOWN), "law"),
        Unknown(besides + log(PRIOR_UNKNOWN) + prior, "besides"),
        Unknown(strained, "strain"),
    )
    return max(found, key=lambda each: each.weight)


def weigh(findings: Findings, unknown: Unknown) -> list[Weighed]:
    """All hypotheses by falling weight, but for those whose fit was lost."""
    count = len(findings.scores)
    found = [
        Weighed("none", (), findings.base.evidence + prior_of((), count), findings.base),
        Weighed("unknown", (), unknown.weight, None),
    ]
    found += [
        Weighed(" + ".join(mode.terms), mode.terms, mode.evidence + prior_of(mode.terms, count), mode)
        for mode in findings.modes
    ]
    fitted = {*(mode.terms for mode in findings.modes), *findings.lost}
    found += [
        Weighed(
            score.term.name, (score.term.name,), score.evidence + prior_of((score.term.name,), count), None
        )
        for score in findings.scores
        if (score.term.name,) not in fitted
    ]
    return sorted(found, key=lambda each: -each.weight)


def reweighed(weighed: Sequence[Weighed], mode: Mode, own: float, unknown: float) -> list[Weighed]:
    """All hypotheses by falling weight, with another log weight of the one fitted by ``mode`` and of "unknown"."""
    found = [
        replace(each, weight=own)
        if each.mode is mode
        else replace(each, weight=unknown)
        if each.name == "unknown"
        else each
        for each in weighed
    ]
    return sorted(found, key=lambda each: -each.weight)


def probabilities(weighed: list[Weighed]) -> NDArray[np.float64]:
    """Their probabilities, (n,), which sum to 1."""
    weights = np.array([each.weight for each in weighed])
    shares = np.exp(weights - weights.max())
    return np.asarray(shares / shares.sum())


def odds_of(weighed: Sequence[Weighed]) -> float:
    """Log odds that something is missing, the best fitted hypothesis or an unknown one, against nothing."""
    something = [
        each.weight for each in weighed if each.name == "unknown" or (each.effects and each.mode is not None)
    ]
    return max(something) - next(each.weight for each in weighed if each.name == "none")


def kind_of(weighed: list[Weighed], change: Change, left: float) -> tuple[Kind, Weighed]:
    """What may be said, and the hypothesis that it rests on.

    ``change`` is what the best fitted hypothesis does to the response; ``left`` the share of the excess misfit that
    it leaves.
    """
    by_name = {each.name: each for each in weighed}
    none, unknown = by_name["none"], by_name["unknown"]
    fitted = [each for each in weighed if each.mode is not None and each.effects]
    best = fitted[0] if fitted else none
    if odds_of(weighed) < SURE:
        return "none", none
    if unknown.weight > best.weight:
        return "unknown", unknown
    if not change.matters:
        return "none", none
    if left > LEFT:
        return "unknown", unknown
    return ("effect" if len(best.effects) == 1 else "several"), best


def rivals_of(weighed: list[Weighed], chosen: Weighed) -> tuple[str, ...]:
    """Effects that cannot be told from those of the chosen hypothesis: one of them in place of one of these.

    A hypothesis that is much less probable beforehand only is one of them: that is not what the campaign tells.
    """
    near = [
        each.effects
        for each in weighed
        if len(each.effects) == len(chosen.effects)
        and (each.weight > chosen.weight - CONFUSED or _fits_as_well(each, chosen))
    ]
    others = (tuple(name for name in effects if name not in chosen.effects) for effects in near)
    return tuple(dict.fromkeys(names[0] for names in others if len(names) == 1))


def _fits_as_well(each: Weighed, chosen: Weighed) -> bool:
    """Whether the data alone, without what is known beforehand, do not tell a hypothesis from the chosen one."""
    if each.mode is None or chosen.mode is None:
        return False
    return each.mode.misfit.value > chosen.mode.misfit.value - CONFUSED
