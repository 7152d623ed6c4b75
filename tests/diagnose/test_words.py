"""What a diagnosis says where the verdict needs a reason."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from savgs_ident.core.status import Status
from savgs_ident.diagnose.engine.search import Findings
from savgs_ident.diagnose.engine.strain import Strain
from savgs_ident.diagnose.judgement import Judged
from savgs_ident.diagnose.result import Shrink
from savgs_ident.diagnose.verdict import SURE, Reason, Strained, Unknown, Weighed
from savgs_ident.diagnose.words import verdict_of, warnings_of

GAP = Shrink(0.3, 0.04, 0.002, 0.0015, 0.99, (0.98, 1.0))
PLACE: Any = SimpleNamespace(name="rail", share=0.9, evidence=50.0)


def _mode(evidence: float, *terms: str) -> Any:
    return SimpleNamespace(terms=terms, evidence=evidence, status=Status.CONVERGED)


def _judged(kind: Any, reason: Reason, weights: dict[str, float], **more: Any) -> Judged:
    """A judgement by the weights of "none", "unknown" and single effects."""
    effects = {name: weight for name, weight in weights.items() if name not in ("none", "unknown")}
    weighed = [Weighed(name, (name,), weight, _mode(weight, name)) for name, weight in effects.items()]
    weighed += [
        Weighed("none", (), weights["none"], _mode(weights["none"])),
        Weighed("unknown", (), weights["unknown"], None),
    ]
    ranked = tuple(sorted(weighed, key=lambda each: -each.weight))
    modes = tuple(each.mode for each in weighed if each.mode is not None and each.effects)
    return Judged(
        findings=Findings(_mode(weights["none"]), (), modes, more.get("lost", ())),
        places=(PLACE,),
        weighed=ranked,
        unknown=Unknown(weights["unknown"], reason),
        strained=Strained(weights["unknown"], Strain(20.0, "k_t", -4.2), tuple(effects)),
        kind=kind,
        chosen=next(each for each in ranked if each.name == kind),
        left=0.08,
        settled=more.get("settled", True),
        another_law=more.get("another_law", False),
    )


def test_something_unknown_is_told_with_how_near_the_catalogue_comes() -> None:
    judged = _judged("unknown", "law", {"none": 0.0, "unknown": 900.0, "rail_viscous": 700.0})
    verdict = verdict_of(judged, (), GAP)
    assert "law learned at the port 'rail' accounts for 90 %" in verdict.sentence
    assert verdict.sentence.endswith(
        "The nearest in the catalogue, rail_viscous, leaves 8 % of the misfit beyond the noise."
    )
    assert verdict.ports == ("rail",)


@pytest.mark.parametrize(
    ("weights", "start"),
    [
        ({"none": 0.0, "unknown": 900.0, "rail_viscous": 700.0}, "With rail_viscous the model would need"),
        ({"none": 0.0, "unknown": 900.0}, "The model would need"),
    ],
)
def test_a_tolerance_that_does_not_hold_is_named(weights: dict[str, float], start: str) -> None:
    verdict = verdict_of(_judged("unknown", "strain", weights), (), GAP)
    assert verdict.sentence.endswith(
        f"{start} k_t 4.2 tolerances below its sheet, which shows at the port 'tyre_radial'."
    )
    assert verdict.ports == ("tyre_radial",)


@pytest.mark.parametrize("another_law", [False, True])
def test_an_effect_by_another_law_is_said_to_be_one(another_law: bool) -> None:
    weights = {"none": 0.0, "unknown": 100.0, "rail_stribeck": 900.0}
    judged = _judged("rail_stribeck", "law", weights, another_law=another_law)
    verdict = verdict_of(replace(judged, kind="effect"), (), GAP)
    told = "acts by another law than the catalogue's, which leaves 8 % of the misfit beyond the noise"
    assert (told in verdict.sentence) is another_law
    assert ("at the port 'rail', too" in verdict.sentence) is another_law
    assert verdict.another_law is another_law
    assert verdict.effects == ("rail_stribeck",)


@pytest.mark.parametrize(
    ("odds", "told"),
    [
        (-3.0, ""),
        (3.0, "Evidence of 3.0 nat speaks for something missing"),
        (SURE + 90.0, "too little to matter"),
    ],
)
def test_nothing_missing_is_told_with_what_speaks_against_it(odds: float, told: str) -> None:
    judged = _judged("none", "law", {"none": 0.0, "unknown": -20.0, "rail_viscous": odds})
    sentence = verdict_of(judged, (), GAP).sentence
    assert sentence.startswith("Nothing is missing that these data show")
    assert told in sentence
    assert sentence.count(".") >= 2 + bool(told)


def test_what_could_not_be_judged_or_settled_is_a_warning() -> None:
    judged = _judged(
        "unknown", "law", {"none": 0.0, "unknown": 900.0}, lost=(("gear_backlash",),), settled=False
    )
    case: Any = SimpleNamespace(base=_mode(0.0))
    told = " ".join(warnings_of(case, _mode(0.0), judged, GAP))
    assert "The fit of gear_backlash found no motion" in told
    assert "could not be found again on twice the nodes" in told


@pytest.mark.parametrize(("recalibrated", "warned"), [(0.0016, False), (0.003, False), (0.02, True)])
def test_a_baseline_that_misses_by_what_no_law_explains_is_warned_of(
    recalibrated: float, warned: bool
) -> None:
    judged = _judged("none", "law", {"none": 0.0, "unknown": -20.0})
    gap = replace(GAP, recalibrated=recalibrated)
    case: Any = SimpleNamespace(base=_mode(0.0))
    told = warnings_of(case, _mode(0.0), judged, gap)
    assert bool(told) is warned
    assert all("follow no law at any port" in each for each in told)
