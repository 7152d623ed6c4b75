"""Marks of diagnoses made by hand, and what many of them say together."""

import json
from dataclasses import asdict, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.validation.blind_marks import failed, port_in_question, score_of, stand_in
from savgs_ident.validation.blind_rates import (
    NOTHING,
    OTHERS,
    TWO,
    UNKNOWN,
    Rate,
    confusion_of,
    rates_of,
)
from savgs_ident.validation.blind_score import Score, is_right, said_right, score_from

from .blind_answers import answer, diagnosis

LAG = answer("effect", "accel_lag", accel_lag_time=0.01)
PAIR = answer("two", "accel_lag", "rail_viscous", accel_lag_time=0.01, rail_viscous_damping=50.0)
GONE = answer("unknown", "accel_lag")
NONE = answer("none")


def test_the_drawn_effect_named_and_located() -> None:
    score = score_of(LAG, diagnosis("effect", "accel_lag"))
    assert score.named_right is True
    assert score.located_right is True
    assert (score.false_alarm, score.unknown_recognised, score.both_named) == (None, None, None)
    assert score.share_closed == 0.99


def test_an_effect_at_the_same_port_is_located_but_not_named() -> None:
    score = score_of(LAG, diagnosis("effect", "accel_gain"))
    assert score.named_right is False
    assert score.located_right is True
    assert score.named_exactly is False


@pytest.mark.parametrize(
    ("imitators", "like", "right"),
    [
        (("gear_compliance",), ("mount_compliance", "cam_scale"), True),
        (("gear_compliance",), ("cam_scale",), False),
        ((), ("mount_compliance",), False),
        (("accel_gain",), ("mount_compliance",), False),
    ],
)
def test_what_does_the_same_counts_where_the_verdict_says_so(
    imitators: tuple[str, ...], like: tuple[str, ...], right: bool
) -> None:
    truth = replace(answer("effect", "mount_compliance"), imitators=imitators)
    score = score_of(truth, diagnosis("effect", "gear_compliance", like=like))
    assert (score.named_right, score.located_right, score.named_exactly) == (right, right, False)
    assert not said_right(score)


def test_what_is_said_is_true_of_the_drawn_effects_alone() -> None:
    assert said_right(score_of(LAG, diagnosis("effect", "accel_lag")))
    assert said_right(score_of(PAIR, diagnosis("several", "rail_viscous", "accel_lag")))
    assert not said_right(score_of(PAIR, diagnosis("effect", "accel_lag")))
    assert not said_right(score_of(LAG, diagnosis("none")))


@pytest.mark.parametrize("verdict", [diagnosis("none"), diagnosis("unknown", ports=["rail"])])
def test_an_effect_that_is_not_named(verdict: dict[str, object]) -> None:
    score = score_of(LAG, verdict)
    assert score.named_right is False
    assert score.located_right is False


def test_one_effect_too_many_is_not_right() -> None:
    score = score_of(LAG, diagnosis("several", "accel_lag", "rail_viscous"))
    assert score.named_right is False
    assert score.located_right is False


def test_two_effects_in_any_order() -> None:
    right = score_of(PAIR, diagnosis("several", "rail_viscous", "accel_lag"))
    assert right.both_named is True
    assert right.located_right is True
    assert right.named_right is None
    half = score_of(PAIR, diagnosis("effect", "accel_lag"))
    assert half.both_named is False
    assert half.located_right is False


def test_nothing_missing() -> None:
    assert score_of(NONE, diagnosis("none")).false_alarm is False
    assert score_of(NONE, diagnosis("none")).located_right is None
    assert score_of(NONE, diagnosis("effect", "cam_scale")).false_alarm is True
    assert score_of(NONE, diagnosis("unknown", ports=["rail"])).false_alarm is True


def test_an_effect_that_the_catalogue_lacks() -> None:
    there = score_of(GONE, diagnosis("unknown", ports=["sensor.sprung_accel"]))
    assert (there.unknown_recognised, there.located_right) == (True, True)
    elsewhere = score_of(GONE, diagnosis("unknown", ports=["rail"]))
    assert (elsewhere.unknown_recognised, elsewhere.located_right) == (True, False)
    reported = score_of(GONE, diagnosis("unknown", ports=["rail"], beside=["sensor.sprung_accel"]))
    assert (reported.located_right, reported.located_exactly) == (True, False)
    untold = score_of(GONE, diagnosis("unknown", ports=["rail"], beside=["strut"]))
    assert (untold.located_right, untold.located_exactly) == (False, False)
    assert (there.located_exactly, elsewhere.located_exactly) == (True, False)
    named = score_of(GONE, diagnosis("effect", "accel_gain"))
    assert (named.unknown_recognised, named.located_right) == (False, True)


@pytest.mark.parametrize(("odds", "same"), [(0.5, True), (-3.0, True), (6.0, False), (None, False)])
def test_in_place_of_a_removed_effect_one_may_be_named_that_does_the_same(
    odds: float | None, same: bool
) -> None:
    found = diagnosis("effect", "rail_viscous")
    assert stand_in(GONE, found) == "rail_viscous"
    score = score_of(GONE, found, elsewhere=odds)
    assert (score.imitated, is_right(score)) == (same, same)
    assert (score.unknown_recognised, score.located_right) == ((None, None) if same else (False, False))


@pytest.mark.parametrize(
    "found",
    [
        diagnosis("none"),
        diagnosis("unknown", ports=["rail"]),
        diagnosis("several", "rail_viscous", "cam_scale"),
    ],
)
def test_nothing_stands_in_for_a_removed_effect_but_one_effect(found: dict[str, object]) -> None:
    assert stand_in(GONE, found) is None
    assert not score_of(GONE, found, elsewhere=0.0).imitated


@pytest.mark.parametrize(("elsewhere", "right"), [(0.5, True), (6.0, False), (None, False)])
def test_a_law_in_place_of_an_effect_may_be_learned_where_that_would_do_the_same(
    elsewhere: float | None, right: bool
) -> None:
    found = diagnosis("effect", "rail_viscous", beside=["sensor.sprung_accel"])
    found["verdict"]["law_known"] = False
    assert port_in_question(GONE, found) == "rail"
    score = score_of(GONE, found, elsewhere=elsewhere)
    assert (score.unknown_recognised, score.located_right, score.located_exactly) == (True, right, False)
    assert not said_right(score)


def test_only_a_learned_law_at_a_wrong_port_beside_a_listed_one_is_in_question() -> None:
    learned = diagnosis("effect", "accel_gain", beside=["rail"])
    learned["verdict"]["law_known"] = False
    assert port_in_question(GONE, learned) is None
    assert port_in_question(GONE, diagnosis("effect", "rail_viscous", beside=["sensor.sprung_accel"])) is None
    unlisted = diagnosis("effect", "rail_viscous", beside=["strut"])
    unlisted["verdict"]["law_known"] = False
    assert port_in_question(GONE, unlisted) is None


def test_of_two_effects_the_one_that_calibration_hides_may_be_left_out() -> None:
    """Its four standard deviations are seen by nobody; the other's twenty are."""
    dim = replace(PAIR, sigmas={"accel_lag": 20.0, "rail_viscous": 4.0})
    seen = score_of(dim, diagnosis("effect", "accel_lag"))
    assert (seen.left_alone, seen.both_named, seen.located_right, is_right(seen)) == (True, None, None, True)
    both = score_of(dim, diagnosis("several", "accel_lag", "rail_viscous"))
    assert (both.left_alone, both.both_named, is_right(both)) == (False, True, True)
    other = score_of(dim, diagnosis("effect", "accel_gain"))
    assert (other.left_alone, other.both_named, is_right(other)) == (False, False, False)
    nothing = score_of(dim, diagnosis("none"))
    assert (nothing.left_alone, nothing.both_named, is_right(nothing)) == (False, False, False)
    assert rates_of([seen, both, other])["hidden_left_alone"] == Rate(1, 1)


def test_beside_a_hidden_effect_another_may_be_named_that_does_the_same_as_the_other_one() -> None:
    dim = replace(PAIR, sigmas={"accel_lag": 20.0, "rail_viscous": 4.0}, imitators=("deflection_delay",))
    told = score_of(dim, diagnosis("effect", "deflection_delay", like=["accel_lag"]))
    assert (told.left_alone, told.both_named, told.located_right, is_right(told)) == (True, None, None, True)
    # It is right to name it, but it is not there.
    assert not said_right(told)
    assert score_from(json.loads(json.dumps(asdict(told)))) == told
    untold = score_of(dim, diagnosis("effect", "deflection_delay"))
    assert (untold.left_alone, is_right(untold)) == (False, False)
    # What is listed is the hidden one, or what is named does not do the same.
    hidden = score_of(dim, diagnosis("effect", "deflection_delay", like=["rail_viscous"]))
    assert (hidden.left_alone, is_right(hidden)) == (False, False)
    unlike = score_of(dim, diagnosis("effect", "accel_gain", like=["accel_lag"]))
    assert (unlike.left_alone, is_right(unlike)) == (False, False)
    seen = score_of(
        replace(dim, sigmas={"accel_lag": 20.0, "rail_viscous": 9.0}), diagnosis("effect", "accel_lag")
    )
    assert (seen.left_alone, is_right(seen)) == (False, False)


def test_an_effect_of_which_held_out_tests_show_too_little_may_be_left_alone() -> None:
    alone = diagnosis("none")
    alone["shrink"] |= {"recalibrated": 0.0032, "floor": 0.002}
    score = score_of(LAG, alone)
    assert (score.left_alone, score.named_right, score.located_right, is_right(score)) == (
        True,
        None,
        None,
        True,
    )
    alone["shrink"] |= {"recalibrated": 0.0045}
    shown = score_of(LAG, alone)
    assert (shown.left_alone, shown.named_right, shown.located_right, is_right(shown)) == (
        *(False, False, False),
        False,
    )


def test_where_another_effect_does_the_same_as_one_that_was_removed_it_may_be_named() -> None:
    gone = replace(GONE, imitators=("deflection_delay",))
    named = score_of(gone, diagnosis("effect", "deflection_delay"))
    assert (named.imitated, named.unknown_recognised, named.located_right, is_right(named)) == (
        *(True, None, None),
        True,
    )
    other = score_of(gone, diagnosis("effect", "rail_viscous"))
    assert (other.imitated, other.unknown_recognised, is_right(other)) == (False, False, False)


def test_in_place_of_one_of_two_effects_another_may_be_named_that_does_the_same() -> None:
    pair = replace(PAIR, imitators=("rail_preload",))
    told = score_of(pair, diagnosis("several", "accel_lag", "rail_preload", like=["rail_viscous"]))
    assert (told.both_named, told.located_right) == (True, True)
    untold = score_of(pair, diagnosis("several", "accel_lag", "rail_preload"))
    assert untold.both_named is False


@pytest.mark.parametrize(
    ("stated", "like", "right"),
    [
        ((0.55, 0.44), ["rail_viscous"], True),
        ((0.99, 0.008), ["rail_viscous"], True),
        ((0.99, 0.005), ["rail_viscous"], False),
        ((0.55, 0.44), [], False),
        ((0.0, 0.0), ["rail_viscous"], False),
    ],
)
def test_or_one_of_two_effects_that_are_about_as_probable(
    stated: tuple[float, float], like: list[str], right: bool
) -> None:
    """Within 5 nat, a ratio of 148, by the recordings that were diagnosed."""
    found = diagnosis("several", "accel_lag", "cam_scale", like=like)
    found["which"] = [
        {"effects": [*names], "probability": probability, "parameters": {}}
        for names, probability in zip(
            (("accel_lag", "cam_scale"), ("rail_viscous", "accel_lag")), stated, strict=True
        )
    ]
    score = score_of(PAIR, found)
    assert (score.both_named, score.located_right, score.located_exactly) == (right, right, False)


def test_a_law_that_is_said_to_be_none_of_the_catalogue() -> None:
    """The formula that comes nearest is not named, though its name stands in the verdict."""

    def learned(effect: str) -> dict[str, object]:
        found = diagnosis("effect", effect)
        found["verdict"] |= {"law_known": False, "families": ["sensor.sprung_accel/dynamics"]}
        return found

    known = score_of(LAG, learned("accel_lag"))
    assert (known.named_right, known.located_right, known.intervals) == (False, True, {})
    gone = score_of(GONE, learned("accel_tilt"))
    assert (gone.unknown_recognised, said_right(gone)) == (True, True)
    assert str(gone) == (
        "trial 1: accel_lag (not in the catalogue); verdict another law, nearest to accel_tilt "
        "(sensor.sprung_accel/dynamics): right"
    )
    elsewhere = score_of(GONE, learned("rail_viscous"))
    assert (elsewhere.unknown_recognised, said_right(elsewhere)) == (True, False)


@pytest.mark.parametrize("truth", [LAG, PAIR, GONE, NONE])
def test_a_diagnosis_that_failed_is_never_right(truth) -> None:
    score = score_of(truth, failed("cannot be read"))
    marks = (score.named_right, score.located_right, score.unknown_recognised, score.both_named)
    assert not any(marks)


def test_intervals_count_where_all_effects_are_named() -> None:
    both = {"accel_lag_time": (0.009, 0.0095), "rail_viscous_damping": (40.0, 60.0)}
    score = score_of(PAIR, diagnosis("several", "rail_viscous", "accel_lag", intervals=both))
    assert {name: each.holds for name, each in score.intervals.items()} == {
        "accel_lag_time": False,
        "rail_viscous_damping": True,
    }
    one = diagnosis("effect", "accel_lag", intervals={"accel_lag_time": (0.0, 1.0)})
    assert score_of(PAIR, one).intervals == {}


def test_marks_survive_being_written() -> None:
    found = diagnosis("effect", "accel_lag", intervals={"accel_lag_time": (0.009, 0.011)})
    score = score_of(LAG, found)
    assert score_from(json.loads(json.dumps(asdict(score)))) == score


def _scores() -> list[Score]:
    """Nine trials: three of one effect, two of two, two of none, two of unknown."""
    pairs = [
        (LAG, diagnosis("effect", "accel_lag", intervals={"accel_lag_time": (0.009, 0.011)})),
        (LAG, diagnosis("effect", "accel_gain", like=("accel_lag",))),
        (answer("effect", "cam_scale"), diagnosis("several", "cam_scale", "accel_gain")),
        (PAIR, diagnosis("several", "accel_lag", "rail_viscous", closed=0.5)),
        (PAIR, diagnosis("several", "accel_lag", "cam_scale")),
        (NONE, diagnosis("none")),
        (NONE, diagnosis("effect", "cam_scale")),
        (GONE, diagnosis("unknown", ports=["sensor.sprung_accel"])),
        (GONE, diagnosis("effect", "accel_gain")),
    ]
    return [score_of(truth, said) for truth, said in pairs]


def test_rates_count_only_the_trials_that_they_are_about() -> None:
    rates = {name: (rate.count, rate.total) for name, rate in rates_of(_scores()).items()}
    assert rates == {
        "named_right": (1, 3),
        "located_right": (5, 7),
        "false_alarms": (1, 2),
        "unknown_recognised": (1, 2),
        "both_named": (1, 2),
        "intervals_hold": (1, 1),
        "share_closed_90": (1, 2),
        "named_exactly": (1, 3),
        "located_exactly": (5, 7),
        "hidden_left_alone": (0, 0),
    }


def test_bounds_are_met_or_not_or_not_asked() -> None:
    assert Rate(9, 10, least=0.9).met is True
    assert Rate(8, 10, least=0.9).met is False
    assert Rate(1, 10, most=0.02).met is False
    assert Rate(0, 10, most=0.02).met is True
    assert Rate(0, 0, least=0.9).met is None
    assert Rate(5, 10).met is None
    assert Rate(20, 20, least=0.9, most=0.99).met is True
    assert Rate(1000, 1000, least=0.9, most=0.99).met is False
    assert Rate(17, 20, least=0.9, most=0.99).met is False


@given(total=st.integers(1, 200), data=st.data())
def test_intervals_of_rates_are_those_of_wilson(total: int, data: st.DataObject) -> None:
    count = data.draw(st.integers(0, total))
    expected = binomtest(count, total).proportion_ci(method="wilson")
    rate = Rate(count, total)
    assert rate.low == pytest.approx(expected.low, abs=1e-6)
    assert rate.high == pytest.approx(expected.high, abs=1e-6)


def test_an_interval_contains_its_rate_to_the_last_digit() -> None:
    """Of 14 of 14 the formula gives 1 less one rounding, and a bar of negative length could not be drawn."""
    for total in range(1, 200):
        for count in {0, 1, total - 1, total}:
            rate = Rate(count, total)
            assert rate.low <= count / total <= rate.high


def test_what_is_confused_with_what() -> None:
    confusion = confusion_of(_scores(), tuple(CATALOGUE))
    assert confusion.truths == (NOTHING, "cam_scale", "accel_lag", TWO, UNKNOWN)
    assert confusion.verdicts == (
        NOTHING,
        "cam_scale",
        "accel_gain",
        "accel_lag",
        TWO,
        OTHERS,
        UNKNOWN,
    )
    assert confusion.counts.sum() == 9
    table = {
        (truth, verdict): int(confusion.counts[i, j])
        for i, truth in enumerate(confusion.truths)
        for j, verdict in enumerate(confusion.verdicts)
        if confusion.counts[i, j]
    }
    assert table == {
        (NOTHING, NOTHING): 1,
        (NOTHING, "cam_scale"): 1,
        ("cam_scale", OTHERS): 1,
        ("accel_lag", "accel_lag"): 1,
        ("accel_lag", "accel_gain"): 1,
        (TWO, TWO): 1,
        (TWO, OTHERS): 1,
        (UNKNOWN, UNKNOWN): 1,
        (UNKNOWN, "accel_gain"): 1,
    }
