"""What a verdict would be with each decision constant halved and doubled, from the same fits.

Only constants that weigh hypotheses and judge their weights are varied: they take no new search. The others decide
what is fitted at all, and widths of priors that the fits were made with.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from savgs_ident.core.presentation import no_progress
from savgs_ident.diagnosis.conclusion import LeftOut, conclude, leave_tests_out
from savgs_ident.diagnosis.evidence import Comparison, DiagnosisEvidence, DiagnosisProblem
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
    "alarm_log_odds",
    "indistinguishable_log_odds",
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
    problem: DiagnosisProblem, comparison: Comparison, values: Mapping[str, float]
) -> dict[str, dict[float, Verdict]]:
    """The verdict by the name of a constant and the factor of its value.

    ``values`` are those that the baseline is given with. Tests are left out again only where something else is named.
    """
    kept: dict[Any, LeftOut] = {}

    def verdict(name: str, factor: float) -> Verdict:
        constants = replace(problem.constants, **{name: factor * getattr(problem.constants, name)})
        varied = replace(problem, constants=constants)
        selected = decide_among(varied, comparison)
        what = _what_is_said(selected)
        if what not in kept:
            kept[what] = leave_tests_out(varied, selected, values, no_progress, None)
        solved = replace(kept[what].problem, constants=constants)
        found = conclude(replace(kept[what], problem=solved, evidence=selected), values, None)
        alternatives = indistinguishable(selected.weighed, selected.chosen, constants)
        return write_verdict(found.problem, found.evidence, alternatives, found.gap)

    return {name: {factor: verdict(name, factor) for factor in FACTORS} for name in VARIED}


def _what_is_said(evidence: DiagnosisEvidence) -> tuple[object, ...]:
    """Evidence that says the same needs the same predictions of tests left out."""
    law = evidence.named_law or evidence.offered
    return evidence.kind, evidence.chosen.hypothesis, evidence.unknown.reason, law and law.hypothesis
