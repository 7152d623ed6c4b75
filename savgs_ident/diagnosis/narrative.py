"""The verdict of a diagnosis as a sentence."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import exp, inf

import numpy as np

from savgs_ident.core.presentation import percent
from savgs_ident.diagnosis.evidence import DiagnosisEvidence, DiagnosisProblem, FlexibleMember
from savgs_ident.diagnosis.findings import hypothesis_of, left_over
from savgs_ident.diagnosis.gap import Shrink
from savgs_ident.diagnosis.result import NONE, UNKNOWN, Hypothesis, Verdict
from savgs_ident.diagnosis.thresholds import DecisionConstants
from savgs_ident.diagnosis.verdict import alarm_odds, most_probable, probabilities
from savgs_ident.effects.base import Family
from savgs_ident.inference.laplace_fit import LaplaceFit


def write_verdict(
    problem: DiagnosisProblem, evidence: DiagnosisEvidence, alternatives: Sequence[str], gap: Shrink
) -> Verdict:
    """The verdict with its sentence.

    ``alternatives`` are effects that the campaign cannot distinguish from those named.
    """
    verdict = _verdict(problem, evidence, alternatives, gap)
    return replace(verdict, sentence=verdict.sentence + _drifting(problem.drifts))


def _drifting(drifts: Mapping[str, float]) -> str:
    """Which parameters changed over the campaign, by relative changes of one [1]."""
    if not drifts:
        return ""
    each = " and ".join(
        f"`{name}` {'rose' if change > 0.0 else 'fell'} by {100.0 * abs(change):.2g} %"
        for name, change in drifts.items()
    )
    return f" While the campaign went on, {each}: the recalibrated model follows that."


def _verdict(
    problem: DiagnosisProblem, evidence: DiagnosisEvidence, alternatives: Sequence[str], gap: Shrink
) -> Verdict:
    if evidence.kind == "none":
        sentence = _nothing_missing(problem, evidence, gap)
        return Verdict("none", (), (), (), sentence, probability=_probability_of_nothing(evidence))
    if evidence.kind == "unknown":
        if _is_sheet_wrong(evidence):
            return _sheet_wrong(problem, evidence, gap)
        ports = evidence.indistinguishable_ports(problem.constants)
        sentence = _something_unknown(problem, evidence, gap)
        offered = evidence.offered
        families = (
            ()
            if offered is None or offered.location != evidence.port
            else problem.families(offered.hypothesis)
        )
        return Verdict(
            "unknown",
            (),
            (evidence.port,),
            (),
            sentence,
            ports,
            families=families,
            law_known=False,
            probability=_probability(evidence, UNKNOWN, *evidence.insufficient),
        )
    member = evidence.named_law
    if member is not None:
        nearest = _nearest_effect(problem, evidence, member)
        return Verdict(
            kind="effect",
            effects=() if nearest is None else (nearest,),
            ports=(member.location,),
            confusable_with=(),
            sentence=_law_missing(problem, evidence, member, nearest, gap),
            confusable_ports=evidence.indistinguishable_ports(problem.constants),
            families=problem.families(member.hypothesis),
            law_known=False,
            probability=_probability(evidence, member.hypothesis),
        )
    hypothesis = evidence.chosen.hypothesis
    return Verdict(
        kind=evidence.kind,
        effects=hypothesis.effects,
        ports=problem.locations(hypothesis),
        confusable_with=tuple(alternatives),
        sentence=_effects_missing(problem, evidence, alternatives, gap),
        confusable_ports=_other_ports(problem, evidence, alternatives),
        families=problem.families(hypothesis),
        probability=_probability(evidence, hypothesis),
    )


def _other_ports(
    problem: DiagnosisProblem, evidence: DiagnosisEvidence, alternatives: Sequence[str]
) -> tuple[str, ...]:
    """Where the alternatives to the effects that are named act, and a law that would do as much as a single one."""
    here = problem.locations(evidence.chosen.hypothesis)
    alike = evidence.ports_alike(here[0], problem.constants) if len(here) == 1 else ()
    there = (*(problem.location(name) for name in alternatives), *alike)
    return tuple(each for each in dict.fromkeys(there) if each not in here)


def _probability(evidence: DiagnosisEvidence, *hypotheses: Hypothesis) -> float:
    """The probability [1] of hypotheses among all."""
    return _sum_of_shares(evidence, dict.fromkeys(hypotheses, 1.0))


def _probability_of_nothing(evidence: DiagnosisEvidence) -> float:
    """The probability [1] that nothing is missing, or too little to matter."""
    return _sum_of_shares(evidence, {NONE: 1.0, **evidence.immaterial})


def _sum_of_shares(evidence: DiagnosisEvidence, parts: Mapping[Hypothesis, float]) -> float:
    """The probabilities of hypotheses, so much of each as ``parts`` say, together [1]."""
    both = zip(evidence.weighed, probabilities(evidence.weighed), strict=True)
    # Rounded, a sum of all may be more than one.
    return min(float(sum(share * parts.get(each.hypothesis, 0.0) for each, share in both)), 1.0)


def _law_missing(
    problem: DiagnosisProblem,
    evidence: DiagnosisEvidence,
    member: FlexibleMember,
    nearest: str | None,
    gap: Shrink,
) -> str:
    sentence = (
        f"The model lacks something at the {problem.location_text(member.location)}: {_KINDS[member.family]}, "
        "by a law that the catalogue does not have."
    )
    sentence += _shrinking(evidence, gap, "a law learned there")
    fits = [mode for mode in evidence.findings.modes if mode.terms == (nearest,)]
    if nearest is not None:
        sentence += f" The nearest formula of the catalogue, {_words(problem, nearest)}, "
        if fits:
            left = left_over(problem.search, problem.base, fits[0], problem.constants)
            mine, its = _explained(member.left), _explained(left)
            sentence += f"explains {its} of the misfit beyond the noise, "
            if mine == its:
                sentence += (
                    f"as the learned law does, but is {_times_less(evidence, fits[0], member)} probable."
                )
            else:
                sentence += f"the learned law {mine}."
        else:
            sentence += "promised too little for a fit."
    else:
        sentence += " The catalogue has no formula of this kind there."
    return sentence + _not_apart(problem, evidence)


def _nearest_effect(
    problem: DiagnosisProblem, evidence: DiagnosisEvidence, member: FlexibleMember
) -> str | None:
    """The catalogue's effect of a learned law's family at its location that comes nearest; None if there is none."""
    catalogue = problem.plant.catalogue
    scored = {each.term.name: each.evidence for each in evidence.findings.scores}
    fitted = {mode.terms[0]: mode.evidence for mode in evidence.findings.modes if len(mode.terms) == 1}
    known = scored | fitted
    there = (name for name in known if problem.location(name) == member.location)
    same = (name for name in there if catalogue[name].law.family is member.family)
    return max(same, key=lambda name: known[name], default=None)


def _words(problem: DiagnosisProblem, effect: str) -> str:
    """What an effect is, with its name."""
    found = problem.plant.catalogue[effect]
    words = found.law.words or _KINDS[found.law.family]
    if found.linear_part_of is not found.law.family:
        words = f"{_KINDS[found.linear_part_of]} that is larger or smaller than on the sheet"
    return f"{words} (`{effect}`)"


def _not_apart(problem: DiagnosisProblem, evidence: DiagnosisEvidence) -> str:
    """The ports that the campaign cannot distinguish from that of something that the catalogue lacks."""
    ports = [problem.location_text(each) for each in evidence.indistinguishable_ports(problem.constants)]
    if not ports:
        return ""
    others = " or the ".join(ports)
    return f" This campaign cannot distinguish the {problem.location_text(evidence.port)} from the {others}."


_KINDS = {
    Family.FRICTION: "a friction",
    Family.DAMPING: "a damping",
    Family.STIFFNESS: "a stiffness",
    Family.STOP: "a stop",
    Family.COMPLIANCE: "something that gives way",
    Family.PLAY: "a play",
    Family.OSCILLATOR: "something that swings",
    Family.NUMBER: "a number that differs from the sheet",
    Family.GAIN: "an error of gain",
    Family.DYNAMICS: "dynamics",
    Family.SHAPE: "an error of shape",
    Family.LEARNED: "something",
}


def _nothing_missing(problem: DiagnosisProblem, evidence: DiagnosisEvidence, gap: Shrink) -> str:
    if evidence.unsupported:
        return (
            f"Nothing can be named: the recalibrated model differs from these data by {percent(gap.recalibrated)} "
            f"of the response, where the noise accounts for {percent(gap.floor)}, but what would explain some tests "
            "predicts those that were held out no better than the model without it. Look for what changed between "
            "the tests."
        )
    return (
        f"These data show nothing missing in the model: the recalibrated model differs from them by "
        f"{percent(gap.recalibrated)} of the response; the noise accounts for {percent(gap.floor)}."
        + _evidence_against(alarm_odds(evidence.weighed), problem.constants)
    )


def _evidence_against(odds: float, constants: DecisionConstants) -> str:
    """The evidence that something is missing, where nothing is named."""
    if odds <= 0.0:
        return ""
    if odds < constants.alarm_log_odds:
        return (
            f" The evidence that something is missing is {odds:.1f} nat, below the threshold of "
            f"{constants.alarm_log_odds:.0f} nat."
        )
    overall, in_one_test = constants.material_share, constants.material_share_of_test
    return (
        f" The effects that would explain more change the response by less than {percent(overall)}, and by less "
        f"than {percent(in_one_test)} in any single test, which is too little to matter."
    )


WORTH_SAYING = 0.01
"""Share of the squared gap [1] that a law at one port accounts for to first order, below which it is not said."""


def _something_unknown(problem: DiagnosisProblem, evidence: DiagnosisEvidence, gap: Shrink) -> str:
    found = evidence.localisation
    where = problem.location_text(found.name)
    sentence = "The model lacks something that no effect of the catalogue explains: "
    if gap.after < gap.recalibrated:
        shrinks = (
            f"from {percent(gap.recalibrated)} recalibrated to {percent(gap.after)} of the response; the noise is "
            f"{percent(gap.floor)}."
        )
        # To first order a strong friction may explain nothing of what it does.
        sentence += (
            f"a law learned at the {where} accounts for {100.0 * found.share:.0f} % of the squared gap in held-out "
            f"tests, which shrinks {shrinks}"
            if found.share >= WORTH_SAYING
            else f"with a law learned at the {where} the gap in held-out tests shrinks {shrinks}"
        )
    else:
        sentence += (
            f"recalibrated it misses by {percent(gap.recalibrated)} of the response, the noise is "
            f"{percent(gap.floor)}, and no law learned at a port predicts held-out tests better; the nearest acts "
            f"at the {where}."
        )
    return sentence + _nearest(problem, evidence) + _not_apart(problem, evidence)


def _is_sheet_wrong(evidence: DiagnosisEvidence) -> bool:
    """Whether a tolerance that does not hold is more probable than anything else."""
    return evidence.unknown.is_tolerance and evidence.weighed[0].hypothesis.unknown


def _sheet_wrong(problem: DiagnosisProblem, evidence: DiagnosisEvidence, gap: Shrink) -> Verdict:
    """The verdict where numbers of the sheet do not hold: which ones, and what would explain nearly as much."""
    off, ports = evidence.broken.conflict.off, evidence.broken.ports or (evidence.port,)
    places = " and the ".join(map(problem.location_text, ports))
    count = _COUNTS.get(len(off), "several").capitalize()
    numbers, do, act = ("A number", "does", "acts") if len(off) == 1 else (f"{count} numbers", "do", "act")
    sentence = (
        f"{numbers} of the data sheet {do} not hold, and no effect of the catalogue is as good an explanation. "
        f"The model would need {_off_sheet(off)}, which {act} at the {places}. Recalibrated it misses by "
        f"{percent(gap.recalibrated)} of the response in held-out tests ({percent(gap.before)} as given); the "
        f"noise is {percent(gap.floor)}."
    )
    least = evidence.unknown.weight - problem.constants.indistinguishable_log_odds
    fitted = [each for each in evidence.weighed if each.mode is not None and each.hypothesis.effects]
    others = [each.hypothesis for each in fitted if each.weight > least]
    if others:
        sentence += f" About as probable: {' or '.join(f'`{each}`' for each in others)}."
    there = dict.fromkeys(place for each in others for place in problem.locations(each))
    return Verdict(
        "unknown",
        (),
        ports,
        tuple(dict.fromkeys(name for each in others for name in each.effects)),
        sentence,
        tuple(each for each in there if each not in ports),
        law_known=False,
        probability=_probability(evidence, UNKNOWN, *evidence.insufficient),
    )


def _off_sheet(off: Mapping[str, float]) -> str:
    """Which numbers are how far off their sheet; ``off`` in tolerances [1], by name."""
    return " and ".join(
        f"`{name}` {abs(far):.1f} tolerances {'above' if far > 0.0 else 'below'} its data sheet"
        for name, far in off.items()
    )


def _nearest(problem: DiagnosisProblem, evidence: DiagnosisEvidence) -> str:
    """The nearest effects of the catalogue."""
    effects = hypothesis_of(most_probable(evidence.findings, problem.constants)).effects
    if not effects:
        return ""
    several, words = len(effects) > 1, " and ".join(_words(problem, name) for name in effects)
    refuted = f", but do{'' if several else 'es'} not predict tests that were held out"
    return (
        f" The nearest effect{'s' if several else ''} of the catalogue, {words}, explain{'' if several else 's'} "
        f"{_explained(evidence.left)} of the misfit beyond the noise"
        f"{refuted if evidence.refuted.effects == effects else ''}."
    )


def _effects_missing(
    problem: DiagnosisProblem, evidence: DiagnosisEvidence, alternatives: Sequence[str], gap: Shrink
) -> str:
    effects = evidence.chosen.hypothesis.effects
    one = len(effects) == 1
    places = [problem.location_text(problem.location(name)) for name in effects]
    words = [_words(problem, name) for name in effects]
    if one:
        sentence = f"The model lacks something at the {places[0]}: {words[0]}."
    else:
        each = "; ".join(f"at the {place}, {word}" for place, word in zip(places, words, strict=True))
        sentence = f"The model lacks {_COUNTS.get(len(effects), 'several')} things: {each}."
    sentence += _shrinking(evidence, gap, "it" if one else "them")
    if evidence.off:
        sentence += f" Besides, the model needs {_off_sheet(evidence.off)}."
    if alternatives:
        others = " or ".join(f"`{name}`" for name in alternatives)
        sentence += f" This campaign cannot distinguish {'it' if one else 'one of them'} from {others}."
    listed = {problem.location(name) for name in alternatives}
    ports = [each for each in _other_ports(problem, evidence, alternatives) if each not in listed]
    if ports:
        others = " or the ".join(problem.location_text(each) for each in ports)
        sentence += f" By a law of another form the {others} could do as much."
    return sentence


def _shrinking(evidence: DiagnosisEvidence, gap: Shrink, named: str) -> str:
    """How far the gap shrinks with what is ``named``; where it does not, what calibration needs in its place."""
    # To the digits that are shown, or the sentence would contradict itself.
    if gap.after < gap.recalibrated and percent(gap.after) != percent(gap.recalibrated):
        return (
            f" With {named} the gap shrinks from {percent(gap.recalibrated)} recalibrated "
            f"({percent(gap.before)} as given) to {percent(gap.after)} of the response in held-out tests; the "
            f"noise is {percent(gap.floor)}."
        )
    base = evidence.findings.base
    worst = int(np.argmax(np.abs(base.x)))
    return (
        f" Calibration closes the gap as well, from {percent(gap.before)} to {percent(gap.recalibrated)} of the "
        f"response in held-out tests (noise {percent(gap.floor)}), but needs `{base.coordinates[worst].name}` "
        f"{abs(base.x[worst]):.1f} standard deviations {'above' if base.x[worst] > 0.0 else 'below'} its sheet."
    )


_COUNTS = {2: "two", 3: "three", 4: "four"}


def _explained(left: float) -> str:
    """What is explained where a share is left; no figure says all where something is left."""
    share = 1.0 - left
    if share <= 0.0:
        return "nothing"
    return "all" if left < 0.0005 else f"{100.0 * share:.0f} %" if share < 0.985 else f"{100.0 * share:.1f} %"


def _times_less(evidence: DiagnosisEvidence, fit: LaplaceFit, member: FlexibleMember) -> str:
    """By how much a formula is less probable than a learned law."""
    weights = (
        each.weight for each in evidence.weighed if each.mode is not None and each.mode.terms == fit.terms
    )
    odds = exp(min(max(member.weight - max(weights, default=-inf), 0.0), 700.0))
    if odds < 1.5:
        return "no less"
    return f"{odds:.2g} times less" if odds < 1e3 else "more than a thousand times less"
