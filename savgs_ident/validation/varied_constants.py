"""How verdicts and marks move when a decision constant is halved or doubled, from the same fits.

Constants are varied where they decide among finished fits. What they change in the search, in the choice of a
baseline that drifts, and in the fits, such as the widths of an effect's priors, is not. Every trial of a run with
``--sensitivity`` gets its verdicts by other constants; they stand in its ``diagnosis.json``, and are marked and
counted here.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from savgs_ident.core.presentation import no_progress
from savgs_ident.diagnosis.conclusion import LeftOut, conclude, leave_tests_out, with_named_fit
from savgs_ident.diagnosis.diagnose import Watch
from savgs_ident.diagnosis.evidence import DiagnosisEvidence, DiagnosisProblem, FittedHypotheses
from savgs_ident.diagnosis.model_selection import decide_among
from savgs_ident.diagnosis.narrative import write_verdict
from savgs_ident.diagnosis.result import Verdict
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.diagnosis.verdict import indistinguishable
from savgs_ident.validation.blind_answer import Answer
from savgs_ident.validation.blind_marks import port_in_question, score_of, stand_in
from savgs_ident.validation.blind_rates import Rate, rates_of
from savgs_ident.validation.blind_score import Score

VARIED = (
    "prior_none",
    "prior_single",
    "prior_pair",
    "prior_unknown",
    "prior_broken_tolerance",
    "broken_tolerance_width",
    "coefficient_uncertainty",
    "rest_uncertainty",
    "unlisted_family_prior",
    "alarm_log_odds",
    "indistinguishable_log_odds",
    "negligible_misfit",
    "material_share",
    "material_share_of_test",
    "sure_of_gap",
    "explained_share",
    "unexplained_share",
    "unexplained_share_flexible",
)
"""Names of the constants that are varied."""

FACTORS = (0.5, 2.0)
"""By what each is multiplied."""


def vary_constants(
    problem: DiagnosisProblem,
    fitted: FittedHypotheses,
    values: Mapping[str, float],
    factors: Sequence[float] = FACTORS,
) -> dict[str, dict[float, Verdict]]:
    """The verdict by the name of a constant and the factor of its value.

    ``values`` are those that the baseline is given with. Tests are left out again only where something else is named.
    """
    kept: dict[Any, LeftOut] = {}

    def verdict(name: str, factor: float) -> Verdict:
        constants = replace(problem.constants, **{name: factor * getattr(problem.constants, name)})
        varied = replace(problem, constants=constants)
        selected = decide_among(varied, fitted)
        what = _what_is_said(selected)
        if what not in kept:
            kept[what] = leave_tests_out(varied, selected, values, no_progress, None)
        left_out = kept[what]
        refitted = replace(selected, refit_failed=left_out.evidence.refit_failed)
        if left_out.evidence.chosen.mode is not None:
            refitted = with_named_fit(refitted, left_out.evidence.chosen.mode)
        solved = replace(left_out.problem, constants=constants)
        found = conclude(replace(left_out, problem=solved, evidence=refitted), values, None)
        alternatives = indistinguishable(selected.weighed, selected.chosen, constants)
        return write_verdict(found.problem, found.evidence, alternatives, found.gap)

    return {name: {factor: verdict(name, factor) for factor in factors} for name in VARIED}


def _what_is_said(evidence: DiagnosisEvidence) -> tuple[object, ...]:
    """Evidence that says the same needs the same predictions of tests left out."""
    law = evidence.named_law or evidence.offered
    return evidence.kind, evidence.chosen.hypothesis, evidence.unknown.reason, law and law.hypothesis


KEY = "sensitivity"
"""The key of the verdicts by other constants in a trial's ``diagnosis.json``."""


@dataclass(frozen=True)
class MovedMarks:
    """The marks of all trials with their verdicts by another constant.

    Attributes:
        constant: name of the constant.
        value: what it is instead.
        trials: how many trials there are.
        changed: how many of them get another verdict.
        rates: all rates, by name.
    """

    constant: str
    value: float
    trials: int
    changed: int
    rates: Mapping[str, Rate]


def varied_into(found: dict[str, Any]) -> Watch:
    """A watcher of a diagnosis that puts verdicts by other constants into ``found``, by constant and factor."""

    def watch(problem: DiagnosisProblem, fitted: FittedHypotheses) -> None:
        varied = vary_constants(problem, fitted, {})
        found[KEY] = {
            name: {str(factor): _written(verdict) for factor, verdict in verdicts.items()}
            for name, verdicts in varied.items()
        }

    return watch


def _written(verdict: Verdict) -> dict[str, Any]:
    """The verdict as a ``diagnosis.json`` has it."""
    return asdict(verdict) | {"families": [str(each) for each in verdict.families]}


def moved_marks(trials: Sequence[tuple[Score, Answer, Mapping[str, Any]]]) -> tuple[MovedMarks, ...]:
    """The marks by every constant; each trial as its score, its answer and the object of its ``diagnosis.json``.

    Empty where none has verdicts by other constants.
    """
    varied_trials = [each for each in trials if _has_verdicts(each[2])]
    return tuple(_moved(varied_trials)) if varied_trials else ()


def _has_verdicts(diagnosis: Mapping[str, Any]) -> bool:
    """Whether all verdicts by other constants are there: an earlier version may have had others."""
    varied = diagnosis.get(KEY)
    return isinstance(varied, dict) and all(
        str(factor) in varied.get(name, {}) for name in VARIED for factor in FACTORS
    )


def _moved(varied_trials: Sequence[tuple[Score, Answer, Mapping[str, Any]]]) -> Iterator[MovedMarks]:
    for name in VARIED:
        for factor in FACTORS:
            scores = [_marked(*each, name, factor) for each in varied_trials]
            changed = sum(
                _said(one) != _said(other) for one, (other, _, _) in zip(scores, varied_trials, strict=True)
            )
            value = factor * getattr(DEFAULTS, name)
            yield MovedMarks(name, value, len(scores), changed, rates_of(scores))


def _marked(score: Score, answer: Answer, diagnosis: Mapping[str, Any], name: str, factor: float) -> Score:
    """The score with another verdict; intervals and gaps, which were not computed again, are those of the trial."""
    moved = {**diagnosis, "verdict": diagnosis[KEY][name][str(factor)]}
    # Of another port or effect than what was named it was not looked at whether it would do the same.
    same = all(asked(answer, moved) == asked(answer, diagnosis) for asked in (port_in_question, stand_in))
    other = score_of(answer, moved, score.version, score.elsewhere if same else None)
    return replace(
        other,
        share_closed=score.share_closed,
        closed_by_effect=score.closed_by_effect,
        intervals=score.intervals,
    )


def _said(score: Score) -> tuple[object, ...]:
    return score.verdict, score.said, score.families, score.located_right, score.port_right
