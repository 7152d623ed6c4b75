"""The verdict of a diagnosis as a sentence, and its warnings."""

from collections.abc import Sequence

from savgs_ident.diagnosis.evidence import DiagnosisEvidence, DiagnosisProblem, FlexibleMember
from savgs_ident.diagnosis.model_selection import nearest_effect
from savgs_ident.diagnosis.result import Shrink, Verdict
from savgs_ident.diagnosis.search import hypothesis_of, left_over
from savgs_ident.diagnosis.thresholds import DecisionConstants
from savgs_ident.diagnosis.verdict import alarm_odds, most_probable, probabilities
from savgs_ident.effects.base import Family
from savgs_ident.inference.find_map import LaplaceFit


def write_verdict(
    problem: DiagnosisProblem, evidence: DiagnosisEvidence, alternatives: Sequence[str], gap: Shrink
) -> Verdict:
    """The verdict with its sentence.

    ``alternatives`` are effects that the campaign cannot distinguish from those named.
    """
    if evidence.kind == "none":
        sentence = _nothing_missing(problem, evidence, gap)
        return Verdict("none", (), (), (), sentence, probability=_probability(evidence, "none"))
    if evidence.kind == "unknown":
        ports = evidence.indistinguishable_ports(problem.constants)
        sentence = _something_unknown(problem, evidence, ports, gap)
        offered = evidence.offered
        families = () if offered is None or offered.location != evidence.port else (str(offered.hypothesis),)
        return Verdict(
            "unknown",
            (),
            (evidence.port,),
            (),
            sentence,
            ports,
            families=families,
            law_known=False,
            probability=_probability(evidence, "unknown"),
        )
    member = evidence.named_law
    if member is not None:
        nearest = nearest_effect(problem, evidence, member)
        return Verdict(
            kind="effect",
            effects=() if nearest is None else (nearest,),
            ports=(member.location,),
            confusable_with=(),
            sentence=_law_missing(problem, evidence, member, nearest, gap),
            confusable_ports=evidence.indistinguishable_ports(problem.constants),
            families=(str(member.hypothesis),),
            law_known=False,
            probability=_probability(evidence, str(member.hypothesis)),
        )
    hypothesis = evidence.chosen.hypothesis
    return Verdict(
        kind=evidence.kind,
        effects=hypothesis.effects,
        ports=problem.locations(hypothesis),
        confusable_with=tuple(alternatives),
        sentence=_effects_missing(problem, evidence, alternatives, gap),
        families=problem.families(hypothesis),
        probability=_probability(evidence, str(hypothesis)),
    )


def _probability(evidence: DiagnosisEvidence, hypothesis: str) -> float:
    """The probability [1] of a hypothesis among all."""
    shares = probabilities(evidence.weighed)
    both = zip(evidence.weighed, shares, strict=True)
    return float(next(share for each, share in both if str(each.hypothesis) == hypothesis))


def _law_missing(
    problem: DiagnosisProblem,
    evidence: DiagnosisEvidence,
    member: FlexibleMember,
    nearest: str | None,
    gap: Shrink,
) -> str:
    sentence = (
        f"The model lacks {_KINDS[member.family]} at the port '{member.location}' by a law that the catalogue does "
        f"not have: with a law learned there the gap shrinks from {_percent(gap.recalibrated)} recalibrated "
        f"({_percent(gap.before)} as given) to {_percent(gap.after)} of the response in held-out tests; the noise is "
        f"{_percent(gap.floor)}."
    )
    fits = [mode for mode in evidence.findings.modes if mode.terms == (nearest,)]
    if fits:
        left = left_over(problem.search, problem.base, fits[0], problem.constants)
        sentence += (
            f" The nearest formula of the catalogue, {nearest}, leaves {_left(left)} of the misfit beyond the noise, "
            f"the learned law {_left(member.left)}."
        )
    elif nearest is not None:
        sentence += f" The nearest formula of the catalogue is {nearest}."
    ports = evidence.indistinguishable_ports(problem.constants)
    if ports:
        sentence += f" This campaign cannot distinguish the port {member.location} from {' or '.join(ports)}."
    return sentence


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
            f"Nothing can be named: the recalibrated model differs from these data by {_percent(gap.recalibrated)} "
            f"of the response, where the noise accounts for {_percent(gap.floor)}, but what would explain some tests "
            "predicts those that were held out no better than the model without it. Look for what changed between "
            "the tests."
        )
    return (
        f"These data show nothing missing in the model: the recalibrated model differs from them by "
        f"{_percent(gap.recalibrated)} of the response; the noise accounts for {_percent(gap.floor)}."
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
        f" The effects that would explain more change the response by less than {_percent(overall)}, and by less "
        f"than {_percent(in_one_test)} in any single test, which is too little to matter."
    )


def _something_unknown(
    problem: DiagnosisProblem, evidence: DiagnosisEvidence, ports: Sequence[str], gap: Shrink
) -> str:
    found = evidence.localisation
    sentence = "The model lacks something that no effect of the catalogue explains: "
    if gap.after < gap.recalibrated:
        sentence += (
            f"a law learned at the port '{found.name}' accounts for {100.0 * found.share:.0f} % of the squared gap "
            f"in held-out tests, which shrinks from {_percent(gap.recalibrated)} recalibrated to "
            f"{_percent(gap.after)} of the response; the noise is {_percent(gap.floor)}."
        )
    else:
        sentence += (
            f"recalibrated it misses by {_percent(gap.recalibrated)} of the response, the noise is "
            f"{_percent(gap.floor)}, and no law learned at a port predicts held-out tests better; the nearest acts "
            f"at the port '{found.name}'."
        )
    sentence += _nearest(problem, evidence)
    if ports:
        sentence += f" This campaign cannot distinguish the port {evidence.port} from {' or '.join(ports)}."
    return sentence


def _nearest(problem: DiagnosisProblem, evidence: DiagnosisEvidence) -> str:
    """The nearest effects of the catalogue, or the tolerance that something unknown would need."""
    if evidence.unknown.reason == "tolerance" and evidence.weighed[0].hypothesis.unknown:
        conflict, effects = evidence.broken.conflict, evidence.broken.beside.effects
        start = f"With {' and '.join(effects)} the" if effects else "The"
        return (
            f" {start} model would need {conflict.parameter} {abs(conflict.tolerances):.1f} tolerances "
            f"{'above' if conflict.tolerances > 0.0 else 'below'} its data sheet, which acts at the port "
            f"'{evidence.port}'."
        )
    effects = hypothesis_of(most_probable(evidence.findings, problem.constants)).effects
    if not effects:
        return ""
    return (
        f" The nearest effect of the catalogue, {' and '.join(effects)}, leaves {_left(evidence.left)} of the misfit "
        "beyond the noise."
    )


def _effects_missing(
    problem: DiagnosisProblem, evidence: DiagnosisEvidence, alternatives: Sequence[str], gap: Shrink
) -> str:
    effects, ports = evidence.chosen.hypothesis.effects, problem.locations(evidence.chosen.hypothesis)
    one = len(effects) == 1
    sentence = (
        f"{' and '.join(effects)} at the port{'' if len(ports) == 1 else 's'} {' and '.join(ports)} "
        f"{'is' if one else 'are'} missing in the model: with {'it' if one else 'them'} the gap shrinks from "
        f"{_percent(gap.recalibrated)} recalibrated ({_percent(gap.before)} as given) to {_percent(gap.after)} of "
        f"the response; the noise is {_percent(gap.floor)}."
    )
    if alternatives:
        which = "it" if one else "one of them"
        sentence += f" This campaign cannot distinguish {which} from {' or '.join(alternatives)}."
    return sentence


def write_warnings(
    problem: DiagnosisProblem, evidence: DiagnosisEvidence, named: LaplaceFit, gap: Shrink
) -> tuple[str, ...]:
    """What the reader must know before using the verdict, a sentence each; ``named`` is the fit of what is named."""
    constants = problem.constants
    found = [
        f"The fit of {hypothesis} found no periodic motion of the plant, so this hypothesis was not evaluated: "
        f"{status.advice}."
        for hypothesis, status in evidence.findings.lost
    ]
    if evidence.refit_failed:
        found.append(
            "The fit of the named effects on twice as many mesh nodes failed: their parameters still contain the "
            "discretisation error."
        )
    for mode, name in (
        (problem.base, "the recalibrated baseline"),
        (named, "the model with the named effects"),
    ):
        if not mode.status.ok:
            found.append(f"The search for {name} did not converge: {mode.status.advice}.")
    if (
        evidence.kind == "none"
        and not evidence.unsupported
        and gap.recalibrated**2 - gap.floor**2 > constants.material_share**2
    ):
        found.append(
            f"The recalibrated model differs by {_percent(gap.recalibrated)} of the response where the noise is "
            f"{_percent(gap.floor)}, by errors that follow no law at any port: look at the tests with the "
            "largest gap."
        )
    if evidence.kind in ("effect", "several") and evidence.left > constants.reported_share:
        found.append(
            f"The named effects leave {100.0 * evidence.left:.1f} % of the baseline's misfit beyond the noise: their "
            "laws are not quite those of the plant, or a small effect is missing besides. The intervals of their "
            "parameters contain the noise alone."
        )
    return tuple(dict.fromkeys(found))


def _left(share: float) -> str:
    return "all" if share >= 0.995 else f"{100.0 * share:.2g} %"


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 0.995 else f"{100.0 * share:.0f} %"
