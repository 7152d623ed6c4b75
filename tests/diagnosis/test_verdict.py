"""What may be said, by the weight of hypotheses."""

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from savgs_ident.core.status import Status
from savgs_ident.diagnosis.findings import Findings, LostHypothesis
from savgs_ident.diagnosis.result import NONE, UNKNOWN, Hypothesis
from savgs_ident.diagnosis.score_test import PriorConflict
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.diagnosis.verdict import (
    BrokenTolerance,
    Change,
    Reason,
    UnknownEvidence,
    WeighedHypothesis,
    alarm_odds,
    broken_tolerance,
    decide,
    indistinguishable,
    most_probable,
    probabilities,
    uncertain_odds,
    unknown_evidence,
    weigh,
    without_immaterial_members,
)
from savgs_ident.inference.laplace_fit import LaplaceFit

from .toy import best_of

FITTED = cast(LaplaceFit, SimpleNamespace(noise_scales=SimpleNamespace(value=-np.inf)))


def _hypothesis(name: str) -> Hypothesis:
    special = {"none": NONE, "unknown": UNKNOWN}
    return special.get(name) or Hypothesis(tuple(name.split(" + ")))


def _weighed(weights: Mapping[str, float], scored: tuple[str, ...] = ()) -> list[WeighedHypothesis]:
    found = []
    for name, weight in weights.items():
        mode: Any = None if name in (*scored, "unknown") else FITTED
        found.append(WeighedHypothesis(_hypothesis(name), weight, mode))
    return sorted(found, key=lambda each: -each.weight)


@pytest.mark.parametrize(
    ("weights", "change", "left", "kind", "name"),
    [
        (
            {"none": 0.0, "unknown": -20.0, "rail_viscous": DEFAULTS.alarm_log_odds - 1.0},
            0.05,
            0.5,
            "none",
            "none",
        ),
        (
            {"none": 0.0, "unknown": -20.0, "rail_viscous": DEFAULTS.alarm_log_odds + 1.0},
            0.05,
            0.0,
            "effect",
            "rail_viscous",
        ),
        (
            {"none": 0.0, "unknown": -20.0, "rail_viscous": 500.0},
            DEFAULTS.material_share / 2.0,
            0.0,
            "none",
            "none",
        ),
        (
            {"none": 0.0, "unknown": 400.0, "rail_viscous": 500.0},
            0.05,
            DEFAULTS.unexplained_share * 2.0,
            "unknown",
            "unknown",
        ),
        (
            {"none": 0.0, "unknown": 600.0, "rail_viscous": 500.0},
            0.05,
            DEFAULTS.explained_share * 1.1,
            "unknown",
            "unknown",
        ),
        # What leaves next to nothing is not something unknown.
        (
            {"none": 0.0, "unknown": 600.0, "rail_viscous": 500.0},
            0.05,
            DEFAULTS.explained_share / 2.0,
            "effect",
            "rail_viscous",
        ),
        ({"none": 0.0, "unknown": 600.0}, 0.0, 1.0, "unknown", "unknown"),
        ({"none": 0.0, "unknown": DEFAULTS.alarm_log_odds - 1.0}, 0.0, 1.0, "none", "none"),
        (
            {"none": 0.0, "unknown": 400.0, "rail_viscous": 500.0},
            DEFAULTS.material_share / 2.0,
            DEFAULTS.unexplained_share * 2.0,
            "none",
            "none",
        ),
        (
            {"none": 0.0, "unknown": 5.0, "spring_rate": 90.0, "spring_rate + accel_lag": 800.0},
            0.05,
            0.0,
            "several",
            "spring_rate + accel_lag",
        ),
    ],
)
def test_kinds(weights: dict[str, float], change: float, left: float, kind: str, name: str) -> None:
    found, chosen = decide(_weighed(weights), Change(change, change), left)
    assert (found, chosen.hypothesis) == (kind, _hypothesis(name))


@pytest.mark.parametrize(("unknown", "kind"), [(600.0, "unknown"), (499.0, "effect")])
def test_a_tolerance_that_explains_more_alone_comes_before_an_effect(unknown: float, kind: str) -> None:
    weighed = _weighed({"none": 0.0, "unknown": unknown, "rail_viscous": 500.0})
    assert decide(weighed, Change(0.05, 0.05), 0.0, unknown_by="tolerance")[0] == kind


def test_only_what_was_fitted_can_be_named() -> None:
    weights = {"none": 0.0, "unknown": -1.0, "rail_viscous": 900.0, "spring_rate": 50.0}
    _, chosen = decide(_weighed(weights, scored=("rail_viscous",)), Change(0.05, 0.05), 0.0)
    assert chosen.hypothesis == Hypothesis(("spring_rate",))


@pytest.mark.parametrize(
    ("constants", "kind"),
    [
        (DEFAULTS, "effect"),
        (replace(DEFAULTS, alarm_log_odds=12.0), "none"),
        (replace(DEFAULTS, material_share=0.06, material_share_of_test=0.06), "none"),
        (replace(DEFAULTS, unexplained_share=0.01), "unknown"),
    ],
)
def test_a_verdict_follows_the_constants_that_it_is_given(constants: DecisionConstants, kind: str) -> None:
    weighed = _weighed({"none": 0.0, "unknown": -20.0, "rail_viscous": 10.0})
    assert decide(weighed, Change(0.05, 0.05), 0.02, constants)[0] == kind


@pytest.mark.parametrize(("odds", "sd"), [(0.0, 3.0), (3.0, 2.0), (6.0, 3.0), (-4.0, 1.0)])
def test_what_is_weighed_badly_is_less_probable_than_its_weight_says(odds: float, sd: float) -> None:
    """Against the integral of the logistic function over a normal density, which the short form meets to 0.02."""
    first = replace(_weighed({"none": 0.0})[0], weight=odds, sd=sd)
    shares = probabilities([first, *_weighed({"none": 0.0})])
    expected, _ = quad(lambda z: norm.pdf(z) / (1.0 + np.exp(-odds - sd * z)), -9.0, 9.0)
    assert shares[0] == pytest.approx(expected, abs=0.01)
    assert 1.0 / (1.0 + np.exp(-uncertain_odds(odds, sd))) == pytest.approx(expected, abs=0.02)


def test_probabilities_are_those_of_the_weights() -> None:
    weighed = _weighed({"none": 0.0, "unknown": -800.0, "spring_rate": np.log(3.0)})
    shares = probabilities(weighed)
    assert shares.sum() == pytest.approx(1.0)
    assert dict(zip((str(each.hypothesis) for each in weighed), shares, strict=True)) == pytest.approx(
        {"spring_rate": 0.75, "none": 0.25, "unknown": 0.0}
    )


def test_alternatives_are_single_effects_that_the_data_hardly_distinguish() -> None:
    weights = {
        "none": 0.0,
        "unknown": 99.0,
        "mount_compliance": 100.0,
        "gear_compliance": 100.0 - DEFAULTS.indistinguishable_log_odds + 1.0,
        "spring_rate": 100.0 - DEFAULTS.indistinguishable_log_odds - 1.0,
        "spring_rate + accel_lag": 99.0,
    }
    weighed = _weighed(weights)
    chosen = next(each for each in weighed if each.hypothesis.effects == ("mount_compliance",))
    assert indistinguishable(weighed, chosen) == ("gear_compliance",)


def test_alternatives_of_a_pair_stand_in_for_one_of_its_members() -> None:
    weights = {
        "none": 0.0,
        "unknown": 99.0,
        "mount_compliance + accel_gain": 100.0,
        "mount_compliance + accel_tilt": 99.0,
        "gear_compliance + accel_gain": 100.0 - DEFAULTS.indistinguishable_log_odds - 1.0,
        "gear_compliance + accel_tilt": 99.5,
        "accel_tilt": 98.0,
    }
    weighed = _weighed(weights)
    assert indistinguishable(weighed, weighed[0]) == ("accel_tilt",)


def test_what_only_the_prior_speaks_against_is_an_alternative() -> None:
    """A sensor that leans by 30 degrees reads as one of less gain does; nobody mounts one like that."""
    effects = {"accel_gain": (100.0, -50.0), "accel_tilt": (60.0, -50.5), "accel_lag": (40.0, -120.0)}
    weighed = [
        WeighedHypothesis(
            Hypothesis((name,)),
            weight,
            cast(LaplaceFit, SimpleNamespace(noise_scales=SimpleNamespace(value=fit))),
        )
        for name, (weight, fit) in effects.items()
    ]
    assert indistinguishable(weighed, weighed[0]) == ("accel_tilt",)


def _mode(evidence: float, *terms: str) -> LaplaceFit:
    return cast(LaplaceFit, SimpleNamespace(terms=terms, evidence=evidence, solved=True))


@pytest.mark.parametrize(
    ("trace", "best"),
    [
        (Change(2.0 * DEFAULTS.material_share, 0.0), ("strut_friction", "rail_stribeck")),
        (Change(0.0, 2.0 * DEFAULTS.material_share_of_test), ("strut_friction", "rail_stribeck")),
        (Change(0.5 * DEFAULTS.material_share, 0.5 * DEFAULTS.material_share_of_test), ("strut_friction",)),
    ],
)
def test_an_effect_that_does_too_little_to_matter_is_no_part_of_a_pair(
    trace: Change, best: tuple[str, ...]
) -> None:
    alone, again = _mode(500.0, "strut_friction"), _mode(790.0, "strut_friction")
    other, pair = _mode(700.0, "rail_viscous"), _mode(800.0, "strut_friction", "rail_stribeck")
    changes = {"strut_friction": Change(0.1, 0.2), "rail_stribeck": trace}
    findings = without_immaterial_members(
        Findings(_mode(0.0), (), (pair, other, alone)),
        lambda _, gone: changes[gone[0]],
        lambda *_: again,
    )
    assert best_of(findings).terms == best
    # What matters is found again from where it is beside the trace, and may be better there.
    kept = (pair, other, alone) if len(best) == 2 else (again, other)
    assert findings.modes == kept


def _score(name: str, evidence: float) -> Any:
    return SimpleNamespace(term=SimpleNamespace(name=name), evidence=evidence)


SCORES = tuple(_score(name, 400.0) for name in ("rail_stribeck", "rail_viscous", "strut_friction"))


def test_a_pair_must_be_better_by_what_it_is_less_probable_beforehand() -> None:
    """Three pairs share a tenth and three singles four: the same odds of four for each."""
    alone, pair = _mode(500.0, "rail_stribeck"), _mode(501.0, "rail_stribeck", "rail_viscous")
    assert most_probable(Findings(_mode(0.0), SCORES, (pair, alone))) is alone
    better = _mode(502.0, "rail_stribeck", "rail_viscous")
    assert most_probable(Findings(_mode(0.0), SCORES, (better, alone))) is better


@pytest.mark.parametrize(
    ("alone", "beside", "broken", "reason"),
    [
        (600.0, -np.inf, 500.0, "law"),
        (400.0, 600.0, 500.0, "law beside effects"),
        (400.0, 500.0, 595.0, "tolerance"),
    ],
)
def test_what_speaks_for_something_unknown_is_known(
    alone: float, beside: float, broken: float, reason: Reason
) -> None:
    findings = Findings(_mode(0.0), SCORES, (_mode(500.0, "rail_stribeck"),))
    tolerance = BrokenTolerance(broken, PriorConflict(20.0, {"k_sd": 8.7}), NONE, ("strut",))
    found = unknown_evidence(findings, alone, beside, tolerance)
    assert found.reason == reason
    assert 590.0 < found.weight < 600.0


def test_a_tolerance_that_an_effect_is_counts_for_the_effect() -> None:
    findings = Findings(_mode(0.0), SCORES, (_mode(500.0, "rail_stribeck"),))
    unknown = unknown_evidence(findings, 400.0, 500.0, None)
    assert unknown.reason == "law beside effects"
    named = Hypothesis(("rail_stribeck",))
    alone = {each.hypothesis: each.weight for each in weigh(findings, unknown)}
    both = {each.hypothesis: each.weight for each in weigh(findings, unknown, as_tolerance={named: (510.0,)})}
    assert both[named] == pytest.approx(np.logaddexp(alone[named], 510.0))
    assert {each for each in alone if alone[each] != both[each]} == {named}


@pytest.mark.parametrize(
    ("terms", "prior"),
    [((), 0.4), (("rail_stribeck",), 0.4 / 3.0), (("rail_stribeck", "tyre_damping"), 0.1 / 3.0)],
)
def test_broken_tolerances_have_the_prior_of_what_is_beside_them(
    terms: tuple[str, ...], prior: float
) -> None:
    conflict = PriorConflict(40.0, {"k_sd": 8.7, "A_y": -6.0, "m_u": 5.0})
    found = broken_tolerance(_mode(500.0, *terms), conflict, 3, {"k_sd": "strut", "m_u": "mass"})
    assert found.beside == Hypothesis(terms)
    assert found.ports == ("strut", "mass")
    assert found.weight == pytest.approx(540.0 + np.log(0.01 * prior))
    assert found.is_likely()
    assert not found._replace(conflict=PriorConflict(4.0, {"k_sd": 3.0})).is_likely()


def test_an_effect_whose_fit_was_lost_is_not_weighed_by_its_score() -> None:
    findings = Findings(
        _mode(0.0),
        SCORES,
        (_mode(300.0, "rail_stribeck"),),
        (LostHypothesis(Hypothesis(("rail_viscous",)), Status.STALLED),),
    )
    weighed = weigh(findings, UnknownEvidence(-5.0, "law"))
    assert [str(each.hypothesis) for each in weighed] == [
        "strut_friction",
        "rail_stribeck",
        "none",
        "unknown",
    ]
    # What was only scored cannot be named, and does not speak for something missing either.
    assert alarm_odds(weighed) == pytest.approx(300.0 - np.log(3.0))
