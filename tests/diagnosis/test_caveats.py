"""What a reader must know before using a verdict."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from savgs_ident.core.status import Status
from savgs_ident.diagnosis.caveats import write_further, write_warnings
from savgs_ident.diagnosis.evidence import counted_with_more
from savgs_ident.diagnosis.findings import LostHypothesis
from savgs_ident.diagnosis.gap import FurtherShrink, Shrink
from savgs_ident.diagnosis.result import Hypothesis
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.diagnosis.verdict import probabilities

from .written_evidence import evidence_of, mode_of


def searched(known: tuple[tuple[str, ...], ...] = (), tests: int = 9) -> Any:
    plant, data = SimpleNamespace(known=known), SimpleNamespace(tests=tests)
    return SimpleNamespace(base=mode_of(0.0), constants=DEFAULTS, drifts={}, plant=plant, data=data)


def test_what_could_not_be_evaluated_or_refitted_is_a_warning() -> None:
    evidence = evidence_of(
        "unknown",
        "law",
        {"none": 0.0, "unknown": 900.0},
        lost=(LostHypothesis(Hypothesis(("gear_backlash",)), Status.MAX_ITERATIONS),),
        refit_failed=True,
    )
    problem: Any = searched()
    reported = " ".join(write_warnings(problem, evidence, mode_of(0.0), 1.0))
    assert "The fit of gear_backlash found no periodic motion of the plant" in reported
    assert "not evaluated: stopped at the iteration limit" in reported
    assert "on twice as many mesh nodes failed" in reported


@pytest.mark.parametrize("tests", [2, 3, 4])
def test_few_tests_are_said_to_make_held_out_figures_rough(tests: int) -> None:
    evidence = evidence_of("none", "law", {"none": 5.0, "unknown": 0.0})
    rough = any(
        "held-out tests are rough" in each
        for each in write_warnings(searched(tests=tests), evidence, mode_of(0.0), 1.0)
    )
    assert rough == (tests < 4)


def test_what_was_tried_together_from_the_first_is_said_so() -> None:
    evidence = evidence_of("rail_viscous", "law", {"none": 0.0, "unknown": 5.0, "rail_viscous": 700.0})
    both = replace(evidence.chosen, hypothesis=Hypothesis(("tyre_friction", "rail_coulomb")))
    evidence = replace(evidence, kind="several", chosen=both)
    given = searched((("rail_coulomb", "tyre_friction"),))
    said = "tyre_friction + rail_coulomb were tried together to begin with"
    assert any(said in each for each in write_warnings(given, evidence, mode_of(0.0), 1.0))
    assert not any(said in each for each in write_warnings(searched(), evidence, mode_of(0.0), 1.0))


def test_what_an_effect_does_not_explain_is_a_warning() -> None:
    evidence = evidence_of("rail_viscous", "law", {"none": 0.0, "unknown": 900.0, "rail_viscous": 700.0})
    evidence = counted_with_more(replace(evidence, kind="effect", left=0.0))
    warnings = write_warnings(searched(), evidence, mode_of(0.0), 1.0)
    assert any("Something more may be missing" in each for each in warnings)


@pytest.mark.parametrize(("besides", "warned"), [(-40.0, False), (40.0, True)])
def test_what_is_named_is_as_probable_as_it_is_with_something_small_besides(
    besides: float, warned: bool
) -> None:
    """It is missing in either case; the table of hypotheses must not call something unknown certain."""
    weights = {"none": 0.0, "rail_viscous": 700.0, "rail_preload": 690.0, "unknown": 700.0 + besides}
    found = evidence_of("rail_viscous", "law beside effects", weights)
    counted = counted_with_more(replace(found, kind="effect", left=0.0))
    chances = dict(
        zip([str(each.hypothesis) for each in counted.weighed], probabilities(counted.weighed), strict=True)
    )
    assert counted.weighed[0] is counted.chosen
    assert chances["rail_viscous"] > 0.9999
    assert chances["unknown"] == 0.0
    said = write_warnings(searched(), counted, mode_of(0.0), 1.0)
    assert any("Something more may be missing" in each for each in said) == warned
    alone = evidence_of("rail_viscous", "law", weights)
    assert counted_with_more(replace(alone, kind="effect")).weighed == alone.weighed


@pytest.mark.parametrize(("after", "said"), [(0.418, True), (0.05, False), (float("nan"), False)])
def test_a_recording_that_took_no_part_and_is_missed_by_far_is_a_warning(after: float, said: bool) -> None:
    held_out = Shrink(0.9, 0.5, 0.019, 0.002, 0.99, (0.98, 1.0))
    found = write_further(FurtherShrink("moves_b.mat", 0.9, 0.6, after, 0.002), held_out)
    assert len(found) == said
    assert all("moves_b.mat" in each and "41.8 %" in each and "1.9 %" in each for each in found)
    assert write_further(None, held_out) == ()
