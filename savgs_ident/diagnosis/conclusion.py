"""The conclusion of a diagnosis: what is named found again, tests held out, and what these leave of the evidence.

Model selection has seen all tests. Here the named hypothesis and its alternatives predict tests that were left out,
and these have the last word (:func:`decide_by_held_out`); the gap that is reported is theirs.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.presentation import Progress
from savgs_ident.core.threads import in_parallel, side_by_side
from savgs_ident.diagnosis.candidates import confusable_of
from savgs_ident.diagnosis.evidence import (
    DiagnosisEvidence,
    DiagnosisProblem,
    FlexibleMember,
    counted_with_more,
)
from savgs_ident.diagnosis.findings import hypothesis_of
from savgs_ident.diagnosis.gap import FurtherShrink, Rows, Shrink, shrinks
from savgs_ident.diagnosis.held_out import HeldOut, hold_out, select_in_folds
from savgs_ident.diagnosis.learning import LearnedLaw
from savgs_ident.diagnosis.problem import ModelPoint
from savgs_ident.diagnosis.result import NONE, UNKNOWN, Hypothesis, NextTest
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.diagnosis.verdict import UnknownEvidence, WeighedHypothesis
from savgs_ident.inference.find_map import find_map
from savgs_ident.inference.laplace_fit import LaplaceFit, search_of

FurtherRecording = Callable[[Sequence[ModelPoint]], FurtherShrink | None]
"""Predicts a recording that takes no part, by two or three models: as given, recalibrated, with what is named."""


@dataclass(frozen=True)
class CorrectedModel:
    """The model with what the verdict puts into it.

    Attributes:
        hypothesis: what that is.
        fit: the fit of the named effects; of the baseline where none are named.
        rows: of the response that it predicts [unit of each reading], (m,), with its most probable tolerated errors.
    """

    hypothesis: Hypothesis
    fit: LaplaceFit
    rows: NDArray[np.float64]


@dataclass(frozen=True)
class Conclusion:
    """What the evidence and the tests that were held out allow to be said.

    Attributes:
        problem: the problem, free of discretisation error about what is named.
        evidence: what may be said.
        law: the learned law that is named or offered, if one is.
        model: the corrected model.
        held: predictions of tests left out, by hypothesis.
        gap: that of all channels together in these tests.
        by_channel: that of each.
        further: that of a recording which took no part.
        next_tests: tests that would separate what is named from what looks like it.
    """

    problem: DiagnosisProblem
    evidence: DiagnosisEvidence
    law: LearnedLaw | None
    model: CorrectedModel
    held: Mapping[Hypothesis, HeldOut]
    gap: Shrink
    by_channel: Mapping[str, Shrink]
    further: FurtherShrink | None
    next_tests: tuple[NextTest, ...]


@dataclass(frozen=True)
class LeftOut:
    """How hypotheses predict tests that were left out.

    Attributes:
        problem: the problem, free of discretisation error about what is named.
        evidence: what is named found again.
        law: the learned law that is named or offered, if one is.
        held: predictions of tests left out, by hypothesis.
        fitted: the gap [1] that the recalibrated baseline leaves where it was fitted to all tests.
        further: that of a recording which took no part.
        next_tests: tests that would separate what is named from what looks like it.
    """

    problem: DiagnosisProblem
    evidence: DiagnosisEvidence
    law: LearnedLaw | None
    held: Mapping[Hypothesis, HeldOut]
    fitted: float
    further: FurtherShrink | None
    next_tests: tuple[NextTest, ...]


def leave_tests_out(
    problem: DiagnosisProblem,
    selected: DiagnosisEvidence,
    values: Mapping[str, float],
    progress: Progress,
    further: FurtherRecording | None,
) -> LeftOut:
    """What is named found again, and tests predicted that were left out, by it and by its alternatives."""
    others = [each for each in _compared(problem, selected) if each is not selected.chosen.mode]
    (refitted, evidence), (tests, held) = side_by_side(
        lambda: refit_named(problem, selected, progress),
        lambda: (_next_tests(problem, selected, progress), _held_out(problem, others, progress)),
    )
    member = _member(evidence)
    law = None if member is None else member.law
    fits = [] if evidence.chosen.mode is None or law is not None else [evidence.chosen.mode]
    last, apart = side_by_side(
        lambda: {
            **_held_out(refitted, fits, progress),
            **_held_out_by_member(member, progress, problem.constants),
        },
        lambda: _predict_further(refitted, evidence, law, values, further),
    )
    held = {**held, **last}
    held = {**held, UNKNOWN: _held_out_unknown(evidence, held[NONE])}
    if evidence.kind == "unknown" and member is not None and held[member.hypothesis].mean <= held[NONE].mean:
        law = None
    return LeftOut(refitted, evidence, law, held, _fitted_gap(problem), apart, tests)


def conclude(left_out: LeftOut, values: Mapping[str, float], further: FurtherRecording | None) -> Conclusion:
    """What tests that were left out leave of what was selected, by the constants of the problem."""
    problem, evidence, law, apart = left_out.problem, left_out.evidence, left_out.law, left_out.further
    member, held = _member(evidence), left_out.held
    model = _corrected_model(problem, evidence, law)
    gap, by_channel = shrinks(problem.data, _left_out_rows(problem, evidence, held, model))
    named = problem.locations(evidence.chosen.hypothesis) if member is None else (member.location,)
    gain = held[model.hypothesis].total - held[NONE].total
    decided = decide_by_held_out(evidence, gap, left_out.fitted, gain, problem.constants, named)
    if decided is not evidence:
        evidence, law = decided, None
        held = {**held, UNKNOWN: _held_out_unknown(evidence, held[NONE])}
        model = _corrected_model(problem, evidence, law)
        gap, by_channel = shrinks(problem.data, _left_out_rows(problem, evidence, held, model))
        apart = _predict_further(problem, evidence, law, values, further)
    counted = counted_with_more(evidence)
    return Conclusion(problem, counted, law, model, held, gap, by_channel, apart, left_out.next_tests)


def _member(evidence: DiagnosisEvidence) -> FlexibleMember | None:
    """The learned law that is named, or offered for something unknown."""
    return evidence.named_law or (evidence.offered if evidence.kind == "unknown" else None)


def decide_by_held_out(
    evidence: DiagnosisEvidence,
    gap: Shrink,
    fitted: float,
    gain: float,
    constants: DecisionConstants = DEFAULTS,
    named: tuple[str, ...] = (),
) -> DiagnosisEvidence:
    """The evidence as tests that were held out allow it to be said: their ``gap`` has the last word.

    ``fitted`` is the gap [1] that the recalibrated baseline leaves where it was fitted to all tests: few or noisy
    tests predict others badly though nothing is missing. ``gain`` is by how much what is named predicts all tests
    better, each left out once: rise of their log density [nat]. ``named`` are the locations of what is named.

    Where what is named predicts them no better than the recalibrated baseline, or by less than could be by chance,
    nothing may be named, unless the baseline predicts them by parameters that are far off their sheet. And where the
    baseline misses them by more than is small, something is missing, whether anything explains it or not. A tolerance
    that does not hold is in the recalibrated baseline already.
    """
    if evidence.kind == "unknown" and evidence.unknown.is_tolerance:
        return evidence
    least = constants.material_share**2 + constants.sure_of_gap * gap.scatter
    small = min(gap.recalibrated, fitted) ** 2 - gap.floor**2 <= least
    predicts = gap.after < gap.recalibrated and gain >= constants.alarm_log_odds
    supported = predicts or (small and evidence.prior_gain >= constants.alarm_log_odds)
    if evidence.kind == "none":
        return evidence if small else _unexplained(evidence)
    if supported or (evidence.kind == "unknown" and not small):
        return evidence
    if not small:
        return _unexplained(evidence, named[0] if len(named) == 1 else "")
    return _nothing_named(evidence)


def _nothing_named(evidence: DiagnosisEvidence) -> DiagnosisEvidence:
    """The evidence where what would be named explains nothing: its weight is that of nothing."""
    gone = (NONE, evidence.chosen.hypothesis)
    weights = [each.weight for each in evidence.weighed if each.hypothesis in gone]
    none = next(each for each in evidence.weighed if each.hypothesis == NONE)
    chosen = replace(none, weight=float(np.logaddexp.reduce(weights)))
    others = [
        replace(each, weight=-np.inf) if each.hypothesis in gone else each
        for each in evidence.weighed
        if each is not none
    ]
    weighed = tuple(sorted((chosen, *others), key=lambda each: -each.weight))
    return replace(evidence, kind="none", chosen=chosen, weighed=weighed, named_law=None, unsupported=True)


def _unexplained(evidence: DiagnosisEvidence, location: str = "") -> DiagnosisEvidence:
    """The evidence where the baseline is not complete, though nothing explains what it misses.

    A baseline with a discrepancy that is not small is no model with nothing missing, and a formula that does not
    predict tests is not what is missing: the weights of both are those of something unknown. It acts at the
    ``location`` of that formula, if there was one.
    """
    gone = (NONE, UNKNOWN, evidence.chosen.hypothesis)
    weights = [each.weight for each in evidence.weighed if each.hypothesis in gone]
    unknown = WeighedHypothesis(UNKNOWN, float(np.logaddexp.reduce(weights)), None)
    others = [
        replace(each, weight=-np.inf) if each.hypothesis in gone else each
        for each in evidence.weighed
        if each.hypothesis != UNKNOWN
    ]
    weighed = tuple(sorted((unknown, *others), key=lambda each: -each.weight))
    known = location if location in evidence.weight_by_location else ""
    return replace(
        evidence,
        kind="unknown",
        chosen=unknown,
        weighed=weighed,
        named_law=None,
        unsupported_at=known,
        refuted=evidence.chosen.hypothesis,
        unknown=UnknownEvidence(unknown.weight, "law"),
    )


def refit_named(
    problem: DiagnosisProblem, evidence: DiagnosisEvidence, progress: Progress
) -> tuple[DiagnosisProblem, DiagnosisEvidence]:
    """The problem and its evidence with the named effects found again, free of the mesh's discretisation error."""
    mode = evidence.chosen.mode
    if evidence.kind not in ("effect", "several") or mode is None or evidence.named_law is not None:
        return problem, evidence
    progress(f"refitting {evidence.chosen.hypothesis}")
    plant = problem.plant.corrected(mode.terms, mode.values, mode.prediction.warm_start)
    if plant is problem.plant:
        return problem, evidence
    if plant is None:
        return problem, replace(evidence, refit_failed=True)
    search = search_of(plant, problem.data)
    found = find_map(
        search, problem.terms(evidence.chosen.hypothesis), mode.values, mode.prediction.warm_start
    )
    if not found.solved:
        return problem, replace(evidence, refit_failed=True)
    return replace(problem, plant=plant, search=search), with_named_fit(evidence, found)


def with_named_fit(evidence: DiagnosisEvidence, found: LaplaceFit) -> DiagnosisEvidence:
    """The evidence with another fit of what is named."""
    chosen, mode = replace(evidence.chosen, mode=found), evidence.chosen.mode
    return replace(
        evidence,
        findings=replace(
            evidence.findings,
            modes=tuple(found if each is mode else each for each in evidence.findings.modes),
        ),
        weighed=tuple(chosen if each is evidence.chosen else each for each in evidence.weighed),
        chosen=chosen,
    )


def _fitted_gap(problem: DiagnosisProblem) -> float:
    """The gap [1] that the recalibrated baseline leaves in the tests that it was fitted to.

    What is known to a tolerance as a curve, and what may drift, is taken at its most probable.
    """
    rows, plant = problem.search.followed(problem.base), problem.plant
    together, _ = shrinks(problem.data, Rows(problem.given, rows, rows, plant.channel, plant.channels))
    return together.recalibrated


def _compared(problem: DiagnosisProblem, evidence: DiagnosisEvidence) -> list[LaplaceFit]:
    """The baseline and the best fitted hypotheses: those that predict tests that were left out."""
    ranked = sorted(evidence.findings.modes, key=lambda each: -each.evidence)
    return [problem.base, *ranked[: problem.constants.held_out_fits]]


def _held_out(
    problem: DiagnosisProblem, modes: Sequence[LaplaceFit], progress: Progress
) -> dict[Hypothesis, HeldOut]:
    """Predictions of tests left out, by hypothesis."""

    def without_parts(mode: LaplaceFit) -> tuple[Hypothesis, HeldOut]:
        hypothesis = hypothesis_of(mode)
        progress(f"leaving tests out: {hypothesis}")
        return hypothesis, hold_out(problem.search, mode, problem.terms(hypothesis), problem.constants)

    return dict(in_parallel(without_parts, modes))


def _held_out_by_member(
    member: FlexibleMember | None, progress: Progress, constants: DecisionConstants
) -> dict[Hypothesis, HeldOut]:
    """What a learned law predicts of tests left out."""
    if member is None:
        return {}
    progress(f"leaving tests out: {member.hypothesis}")
    return {member.hypothesis: member.law.held_out(constants)}


def _held_out_unknown(evidence: DiagnosisEvidence, without: HeldOut) -> HeldOut:
    """What a law known to first order predicts of tests left out; the baseline where it does worse than that."""
    return max(evidence.localisation.held_out, without, key=lambda each: each.mean)


def _left_out_rows(
    problem: DiagnosisProblem,
    evidence: DiagnosisEvidence,
    held: Mapping[Hypothesis, HeldOut],
    model: CorrectedModel,
) -> Rows:
    """Rows of the tests when each was left out, by the three models; what is named is selected anew without each."""
    after = held[model.hypothesis].rows
    if model.hypothesis not in (NONE, UNKNOWN):
        priors = {each.hypothesis: each.weight - each.mode.evidence for each in evidence.weighed if each.mode}
        known = [name for name, each in held.items() if each.evidence and name in priors]
        after = select_in_folds(
            problem.data, [held[name] for name in known], [priors[name] for name in known], problem.constants
        )
    return Rows(
        before=problem.given,
        recalibrated=held[NONE].rows,
        after=after,
        channel=problem.plant.channel,
        channels=problem.plant.channels,
    )


def _corrected_model(
    problem: DiagnosisProblem, evidence: DiagnosisEvidence, law: LearnedLaw | None
) -> CorrectedModel:
    if law is not None:
        member = next(each for each in evidence.flexible if each.law is law)
        return CorrectedModel(member.hypothesis, law.mode, law.search.followed(law.mode))
    if evidence.kind == "unknown":
        return CorrectedModel(UNKNOWN, problem.base, evidence.localisation.held_out.rows)
    fit = evidence.chosen.mode or problem.base
    return CorrectedModel(hypothesis_of(fit), fit, problem.search.followed(fit))


def _predict_further(
    problem: DiagnosisProblem,
    evidence: DiagnosisEvidence,
    law: LearnedLaw | None,
    values: Mapping[str, float],
    further: FurtherRecording | None,
) -> FurtherShrink | None:
    """The gap of a further recording: of the baseline as given, recalibrated, and with what is named.

    Nothing comes after where a law is known to first order alone: no model can be solved with that.
    """
    if further is None:
        return None
    plant, base = problem.plant, problem.base
    points = [ModelPoint(plant, (), values), ModelPoint(plant, (), base.values)]
    if law is not None:
        return further([*points, ModelPoint(law.problem, (law.name,), law.values)])
    if evidence.kind == "unknown":
        return further(points)
    fit = evidence.chosen.mode or base
    return further([*points, ModelPoint(plant, fit.terms, fit.values)])


def _next_tests(
    problem: DiagnosisProblem, evidence: DiagnosisEvidence, progress: Progress
) -> tuple[NextTest, ...]:
    """Tests that separate the chosen hypothesis from the best fitted one that looks like it."""
    chosen = evidence.chosen.mode
    if chosen is None or len(chosen.terms) != 1:
        return ()
    pairs = [each.effects for each in confusable_of(evidence.findings, problem.constants)]
    alike = {name for pair in pairs if chosen.terms[0] in pair for name in pair} - {*chosen.terms}
    lookalikes = [mode for mode in evidence.findings.modes if len(mode.terms) == 1 and mode.terms[0] in alike]
    if not lookalikes:
        return ()
    other = max(lookalikes, key=lambda each: each.evidence)
    progress(f"looking for a test that separates {chosen.terms[0]} from {other.terms[0]}")
    return problem.plant.next_tests(problem.search, chosen, other)
