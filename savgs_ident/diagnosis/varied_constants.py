"""What a verdict would be with each decision constant halved and doubled, from the same fits.

Constants are varied where they decide among finished fits. What they change in the search, in the choice of a
baseline that drifts, and in the fits, such as the widths of an effect's priors, is not.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from savgs_ident.core.presentation import no_progress
from savgs_ident.diagnosis.conclusion import LeftOut, conclude, leave_tests_out, with_named_fit
from savgs_ident.diagnosis.evidence import DiagnosisEvidence, DiagnosisProblem, FittedHypotheses
from savgs_ident.diagnosis.model_selection import decide_among
from savgs_ident.diagnosis.narrative import write_verdict
from savgs_ident.diagnosis.result import Verdict
from savgs_ident.diagnosis.verdict import indistinguishable

VARIED = (
    "prior_none",
    "prior_single",
    "prior_pair",
    "prior_unknown",
    "prior_broken_tolerance",
    "broken_tolerance_width",
    "width_uncertainty",
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
