"""What a diagnosis says where the verdict needs a reason."""

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from savgs_ident.diagnosis import narrative
from savgs_ident.diagnosis.conclusion import decide_by_held_out
from savgs_ident.diagnosis.evidence import (
    DiagnosisProblem,
    FlexibleMember,
    is_better_form,
)
from savgs_ident.diagnosis.gap import Shrink
from savgs_ident.diagnosis.narrative import write_verdict
from savgs_ident.diagnosis.result import Hypothesis, PortFamily, Verdict
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.diagnosis.verdict import (
    Change,
    Reason,
    WeighedHypothesis,
    decide,
)
from savgs_ident.effects.base import Family, Port
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.plants.quarter_car.ports import STRUT, SUSPENSION

from .written_evidence import GAP, PROBLEM, RAIL, RAIL_FRICTION, evidence_of, mode_of


def test_something_unknown_is_reported_with_how_near_the_catalogue_comes() -> None:
    evidence = evidence_of("unknown", "law", {"none": 0.0, "unknown": 900.0, "rail_viscous": 700.0})
    verdict = write_verdict(PROBLEM, evidence, (), GAP)
    assert "law learned at the rail accounts for 90 %" in verdict.sentence
    assert verdict.sentence.endswith(
        "The nearest effect of the catalogue, damping in proportion to the velocity (`rail_viscous`), explains 92 % "
        "of the misfit beyond the noise."
    )
    assert verdict.ports == ("rail",)


def test_what_predicts_no_tests_is_unknown_at_its_port() -> None:
    """A formula that fits all tests and predicts none: what is missing acts there, and follows another law."""
    evidence = evidence_of("rail_viscous", "law", {"none": 0.0, "unknown": 500.0, "rail_viscous": 700.0})
    strut: Any = SimpleNamespace(name="strut", share=0.9, evidence=60.0)
    evidence = replace(evidence, kind="effect", localisations=(strut, RAIL))
    gap = replace(GAP, after=0.05)
    decided = decide_by_held_out(evidence, gap, gap.recalibrated, -5.0, named=("rail",))
    verdict = write_verdict(PROBLEM, decided, (), gap)
    assert (verdict.kind, verdict.ports) == ("unknown", ("rail",))
    # To first order a law at the strut explains more: it is not ruled out.
    assert verdict.confusable_ports == ("strut",)
    assert verdict.probability == pytest.approx(1.0)
    assert "(`rail_viscous`)" in verdict.sentence
    assert "but does not predict tests that were held out." in verdict.sentence


def test_ports_that_do_the_same_are_listed_where_a_prior_decides_between_them() -> None:
    """The law in the joints fits a little better, but stops are no part of joints."""

    def law(port: Port, evidence: float, relative: float) -> FlexibleMember:
        found: Any = SimpleNamespace(mode=SimpleNamespace(evidence=evidence), port=port)
        return FlexibleMember(found, evidence + relative, 0.0, relative_prior=relative)

    laws = (law(STRUT, 990.0, 0.0), law(SUSPENSION, 992.0, np.log(0.1)))
    evidence = evidence_of("unknown", "law", {"none": 0.0, "unknown": 100.0}, flexible=laws)
    named = replace(evidence, kind="effect", named_law=laws[0])
    assert named.indistinguishable_ports() == ("suspension",)


def test_ports_are_listed_where_what_laws_lack_may_decide_between_them() -> None:
    """Twelve nat apart, both of which miss by more."""

    def law(port: Port, evidence: float, sd: float) -> FlexibleMember:
        found: Any = SimpleNamespace(mode=SimpleNamespace(evidence=evidence), port=port)
        return FlexibleMember(found, evidence, 0.0, sd)

    def listed(sd: float) -> tuple[str, ...]:
        laws = (law(STRUT, 990.0, sd), law(SUSPENSION, 978.0, sd))
        evidence = evidence_of("unknown", "law", {"none": 0.0, "unknown": 100.0}, flexible=laws)
        return replace(evidence, kind="effect", named_law=laws[0]).indistinguishable_ports()

    assert listed(1.0) == ()
    assert listed(7.0) == ("suspension",)


def test_a_formula_is_not_named_where_a_law_of_its_family_at_its_port_is_certainly_more_probable() -> None:
    evidence = evidence_of("rail_viscous", "law", {"none": 0.0, "unknown": 5.0, "rail_viscous": 700.0})
    evidence = replace(evidence, kind="effect")

    def member(weight: float, family: Family, left: float = 0.05) -> FlexibleMember:
        law: Any = SimpleNamespace(mode=mode_of(weight), port=SimpleNamespace(location="rail"), family=family)
        return FlexibleMember(law, weight, left)

    assert is_better_form(PROBLEM, evidence, member(730.0, Family.DAMPING))
    assert not is_better_form(PROBLEM, evidence, member(730.0, Family.FRICTION))
    assert not is_better_form(PROBLEM, evidence, member(703.0, Family.DAMPING))
    assert not is_better_form(PROBLEM, evidence, member(730.0, Family.DAMPING, left=0.2))
    assert not is_better_form(PROBLEM, replace(evidence, kind="none"), member(730.0, Family.DAMPING))


def test_a_port_at_which_another_law_would_do_as_much_is_listed_beside_a_formula() -> None:
    evidence = evidence_of("rail_viscous", "law", {"none": 0.0, "unknown": 500.0, "rail_viscous": 700.0})
    alike: Any = SimpleNamespace(name="strut", share=0.9, evidence=RAIL.evidence - 3.0)
    other: Any = SimpleNamespace(name="suspension", share=0.9, evidence=RAIL.evidence - 30.0)
    evidence = replace(evidence, kind="effect", localisations=(alike, other, RAIL))
    verdict = write_verdict(PROBLEM, evidence, (), GAP)
    assert (verdict.effects, verdict.confusable_ports) == (("rail_viscous",), ("strut",))
    assert verdict.sentence.endswith("By a law of another form the strut could do as much.")
    # What a law explains little of says nothing of other ports.
    little: Any = SimpleNamespace(name="rail", share=0.1, evidence=RAIL.evidence)
    hidden = replace(evidence, localisations=(alike, other, little))
    assert write_verdict(PROBLEM, hidden, (), GAP).confusable_ports == ()
    # An effect that cannot be told from the named one has its port listed, too.
    beside = write_verdict(PROBLEM, hidden, ("accel_lag",), GAP)
    assert beside.confusable_ports == ("sensor.sprung_accel",)


def test_a_port_where_a_learned_law_is_about_as_probable_is_listed_beside_a_formula() -> None:
    """However little a law explains to first order: calibration may have taken up what is missing."""
    evidence = evidence_of("rail_viscous", "law", {"none": 0.0, "unknown": 5.0, "rail_viscous": 700.0})

    def listed(weight: float, sd: float, port: str = "suspension") -> tuple[str, ...]:
        learned = Hypothesis(flexible=PortFamily(port, Family.STIFFNESS))
        weighed = (*evidence.weighed, WeighedHypothesis(learned, weight, None, sd))
        told = replace(evidence, kind="effect", localisations=(), weighed=weighed)
        return write_verdict(PROBLEM, told, (), GAP).confusable_ports

    assert listed(699.4, 0.0) == ("suspension",)
    assert listed(690.0, 0.0) == ()
    # Where what the law lacks may decide between them.
    assert listed(690.0, 4.0) == ("suspension",)
    assert listed(699.4, 0.0, "rail") == ()


def test_nothing_that_counts_is_missing_where_what_is_more_probable_does_too_little() -> None:
    evidence = evidence_of(
        "none", "law", {"none": 0.0, "unknown": -5.0, "rail_viscous": 6.0, "accel_lag": 1.0}
    )
    plain = write_verdict(PROBLEM, evidence, (), GAP)
    assert plain.probability == pytest.approx(1.0 / (1.0 + np.exp(6.0) + np.exp(1.0) + np.exp(-5.0)))
    # Of what was only scored, some sizes that the data leave matter and others do not.
    chances = {Hypothesis(("rail_viscous",)): 1.0, Hypothesis(("accel_lag",)): 0.25}
    small = replace(evidence, immaterial=chances)
    more = (np.exp(6.0) + 0.25 * np.exp(1.0)) / (1.0 + np.exp(6.0) + np.exp(1.0) + np.exp(-5.0))
    assert write_verdict(PROBLEM, small, (), GAP).probability == pytest.approx(plain.probability + more)


def test_what_explains_little_speaks_for_something_unknown() -> None:
    evidence = evidence_of(
        "unknown", "law", {"none": 0.0, "unknown": 2.0, "rail_viscous": 6.0, "accel_lag": 1.0}
    )
    plain = write_verdict(PROBLEM, evidence, (), GAP)
    whole = sum(np.exp([0.0, 2.0, 6.0, 1.0]))
    assert plain.probability == pytest.approx(np.exp(2.0) / whole)
    little = replace(evidence, insufficient=(Hypothesis(("rail_viscous",)),))
    found = write_verdict(PROBLEM, little, (), GAP)
    assert found.probability == pytest.approx((np.exp(2.0) + np.exp(6.0)) / whole)


def test_a_number_is_one_with_a_law_of_which_it_is_the_linear_part() -> None:
    absent: Any = None
    plant: Any = SimpleNamespace(catalogue=CATALOGUE)
    problem = DiagnosisProblem(plant, absent, absent, absent, absent)

    def families(*effects: str) -> tuple[str, ...]:
        return tuple(map(str, problem.families(Hypothesis(effects))))

    assert families("tyre_stiffening", "tyre_stiffness") == ("tyre_radial/stiffness",)
    assert families("tyre_stiffening", "tyre_damping") == ("tyre_radial/stiffness", "tyre_radial/number")
    assert families("tyre_stiffness") == ("tyre_radial/number",)
    assert families("bushing_stiffness", "spring_rate") == ("suspension/stiffness", "strut/number")


@pytest.mark.parametrize(
    ("off", "start", "needs"),
    [
        (
            {"k_t": -4.2},
            "A number of the data sheet does not hold,",
            "The model would need `k_t` 4.2 tolerances below its data sheet, which acts at the tyre (radial).",
        ),
        (
            {"k_t": -4.2, "c_t": 5.13},
            "Two numbers of the data sheet do not hold,",
            "`k_t` 4.2 tolerances below its data sheet and `c_t` 5.1 tolerances above its data sheet, which act at",
        ),
    ],
)
def test_tolerances_that_do_not_hold_are_named(off: dict[str, float], start: str, needs: str) -> None:
    evidence = evidence_of("unknown", "tolerance", {"none": 0.0, "unknown": 900.0}, broken=off)
    verdict = write_verdict(PROBLEM, evidence, (), GAP)
    assert verdict.sentence.startswith(start)
    assert needs in verdict.sentence
    assert verdict.ports == ("tyre_radial",)
    assert verdict.confusable_with == ()


def test_tolerances_that_do_not_hold_beside_an_effect_are_said_with_it() -> None:
    weights = {"none": 0.0, "unknown": 5.0, "rail_viscous": 700.0}
    evidence = evidence_of("rail_viscous", "law", weights, off_beside={"k_t": 5.8, "k_sd": -7.7})
    verdict = write_verdict(PROBLEM, replace(evidence, kind="effect", left=0.0), (), GAP)
    assert verdict.sentence.endswith(
        "Besides, the model needs `k_t` 5.8 tolerances above its data sheet and `k_sd` 7.7 tolerances below its data "
        "sheet."
    )


def test_an_effect_that_explains_nearly_as_much_as_a_wrong_sheet_is_listed() -> None:
    evidence = evidence_of("unknown", "tolerance", {"none": 0.0, "unknown": 100.0, "rail_viscous": 96.0})
    verdict = write_verdict(PROBLEM, evidence, (), GAP)
    assert (verdict.confusable_with, verdict.confusable_ports) == (("rail_viscous",), ("rail",))
    assert verdict.sentence.endswith("About as probable: `rail_viscous`.")
    assert verdict.probability == pytest.approx(1.0 / (1.0 + np.exp(-4.0)))


def _verdict_of_a_learned_law(family: Family) -> Verdict:
    """At the rail, where the catalogue's friction explains 96 %."""
    weights = {"none": 0.0, "unknown": 100.0, "rail_stribeck": 900.0}
    mode = mode_of(990.0, "learned_rail")
    law: Any = SimpleNamespace(mode=mode, port=CATALOGUE["rail_stribeck"].port, family=family)
    member = FlexibleMember(law, 980.0, 0.004)
    evidence = evidence_of("rail_stribeck", "law", weights, flexible=(member,), named_law=member)
    mine = WeighedHypothesis(member.hypothesis, 980.0, mode)
    evidence = replace(evidence, kind="effect", chosen=mine, weighed=(mine, *evidence.weighed))
    problem: Any = SimpleNamespace(**vars(PROBLEM), search=None, base=None)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(narrative, "left_over", lambda *args: 0.04)
        return write_verdict(problem, evidence, (), GAP)


def test_a_law_that_the_catalogue_does_not_have_is_reported_with_the_nearest_formula() -> None:
    verdict = _verdict_of_a_learned_law(Family.FRICTION)
    assert verdict.effects == ("rail_stribeck",)
    assert verdict.families == (RAIL_FRICTION,)
    assert not verdict.law_known
    assert verdict.probability == pytest.approx(1.0)
    assert verdict.sentence.startswith(
        "The model lacks something at the rail: a friction, by a law that the catalogue does not have."
    )
    assert verdict.sentence.endswith(
        "more friction at low speed than at high speed (`rail_stribeck`), explains 96 % of the misfit beyond the "
        "noise, the learned law 99.6 %."
    )


def test_of_a_kind_that_the_catalogue_does_not_have_there_no_formula_is_nearest() -> None:
    verdict = _verdict_of_a_learned_law(Family.STIFFNESS)
    assert verdict.effects == ()
    assert tuple(map(str, verdict.families)) == ("rail/stiffness",)
    assert verdict.sentence.endswith("The catalogue has no formula of this kind there.")


@pytest.mark.parametrize(
    ("odds", "reported"),
    [
        (-3.0, ""),
        (3.0, "The evidence that something is missing is 3.0 nat"),
        (DEFAULTS.alarm_log_odds + 90.0, "too little to matter"),
    ],
)
def test_nothing_missing_is_reported_with_what_speaks_against_it(odds: float, reported: str) -> None:
    evidence = evidence_of("none", "law", {"none": 0.0, "unknown": -20.0, "rail_viscous": odds})
    sentence = write_verdict(PROBLEM, evidence, (), GAP).sentence
    assert sentence.startswith("These data show nothing missing in the model")
    assert reported in sentence
    assert sentence.count(".") >= 2 + bool(reported)


GAPS = st.floats(0.0, 0.3)


@settings(deadline=None)
@given(
    odds=st.fixed_dictionaries({"unknown": st.floats(-50.0, 900.0), "rail_viscous": st.floats(-50.0, 900.0)}),
    left=st.floats(0.0, 1.0),
    change=st.floats(0.0, 0.1),
    reason=st.sampled_from(get_args(Reason)),
    gaps=st.tuples(GAPS, GAPS, GAPS, GAPS),
    off=st.floats(-8.0, 8.0),
    worse=st.sampled_from((0.0, 0.2)),
    scatter=st.sampled_from((0.0, 1e-5, 1e-3)),
    gain=st.floats(-20.0, 50.0),
)
def test_no_verdict_contradicts_its_numbers(
    odds: dict[str, float],
    left: float,
    change: float,
    reason: Reason,
    gaps: tuple[float, ...],
    off: float,
    worse: float,
    scatter: float,
    gain: float,
) -> None:
    evidence = replace(evidence_of("none", reason, {"none": 0.0} | odds, off=off), left=left)
    kind, chosen = decide(evidence.weighed, Change(change, change), left, unknown_by=reason)
    # Parameters have something to do with the gap: the noise is the least that is left.
    before, recalibrated, after, floor = gaps[0], max(gaps[1], gaps[3]), max(gaps[2], gaps[3]), gaps[3]
    after = recalibrated if kind == "none" else after
    gap = Shrink(before, recalibrated, after, floor, 0.9, (0.8, 1.0), scatter=scatter)
    # Tests that were held out are predicted worse than tests that were not.
    fitted = max((1.0 - worse) * recalibrated, floor)
    decided = decide_by_held_out(
        replace(evidence, kind=kind, chosen=chosen), gap, fitted, gain, named=("rail",)
    )
    verdict = write_verdict(PROBLEM, decided, (), gap)
    by_chance = DEFAULTS.sure_of_gap * scatter
    large = fitted**2 - floor**2 > DEFAULTS.material_share**2 + by_chance
    explained = left <= DEFAULTS.explained_share and change >= DEFAULTS.material_share_of_test
    tolerance = decided.unknown.is_tolerance and verdict.kind == "unknown"
    if verdict.kind == "none":
        assert not large
    named = odds["rail_viscous"] > DEFAULTS.alarm_log_odds and explained
    predicts = gap.after < gap.recalibrated and gain >= DEFAULTS.alarm_log_odds
    if verdict.kind == "unknown" and named and not tolerance:
        assert not predicts
    if tolerance and named:
        assert odds["unknown"] > odds["rail_viscous"]
    if verdict.kind in ("effect", "several"):
        spared = 0.5 * off**2 >= DEFAULTS.alarm_log_odds and not large
        assert predicts or spared
        digits = {f"{100.0 * each:.2g}" for each in (gap.after, gap.recalibrated)}
        seen = gap.after < gap.recalibrated and len(digits) == 2
        assert ("needs `m_u`" in verdict.sentence) != seen
        assert left <= DEFAULTS.unexplained_share
    if "shrinks from" in verdict.sentence:
        assert gap.after < gap.recalibrated or tolerance
    assert 0.0 <= verdict.probability <= 1.0
    shown = [float(each) / 100.0 for each in re.findall(r"([0-9.e-]+) % recalibrated", verdict.sentence)]
    assert shown == pytest.approx([recalibrated] * len(shown), rel=0.06)
