"""Marks of foreign trials, their rates, and stated probabilities against how often what was said is true."""

import json
from dataclasses import asdict, replace
from typing import Any

import pytest

from savgs_ident.report.blind import blind_html, blind_record, blind_text
from savgs_ident.report.blind_figures import confusion_figure, reliability_figure
from savgs_ident.validation.blind_answer import Answer, SmallErrors
from savgs_ident.validation.blind_marks import failed, port_in_question, score_of
from savgs_ident.validation.blind_rates import (
    EDGES,
    LEFT_ALONE,
    confusion_of,
    median_closed,
    rates_of,
    reliability_by_level,
    reliability_of,
    truth_of,
    verdict_of,
)
from savgs_ident.validation.blind_score import Score, is_right, said_right, score_from
from savgs_ident.validation.foreign_laws import FOREIGN

from ..diagnosis.blind_answers import BLANK, answer, diagnosis

ERRORS = SmallErrors((0.01, 0.0, -0.01), 0.02, 0.3, 2e-4)
NOTHING = replace(BLANK, small_errors=ERRORS, rig={"mu_r": 0.03, "c_sd": 5800.0})


def foreign(name: str, number: int = 1) -> Answer:
    """The truth of a trial with this foreign effect, which changes the response by a tenth."""
    each = FOREIGN[name]
    return replace(
        NOTHING,
        number=number,
        kind="foreign",
        effects=(name,),
        ports=(each.effect.port.location,),
        changes={name: 0.1},
        sigmas={name: 30.0},
        accepted=each.ports,
        families=each.families,
    )


def said(
    kind: str,
    *families: str,
    closed: float | None = 0.95,
    p: float = 0.9,
    gap: float = 0.01,
    **more: Any,
) -> dict[str, Any]:
    """A diagnosis that names families, each as port/family; ``ports`` are theirs where not given.

    The recalibrated ``gap`` is that in held-out tests, where the noise has 0.2 %.
    """
    nearest = {"effect": ["rail_viscous"], "several": ["rail_viscous", "accel_lag"]}.get(kind, [])
    ports = more.pop("ports", list(dict.fromkeys(each.partition("/")[0] for each in families)))
    found = diagnosis(kind, *nearest, ports=ports, **more)
    found["verdict"] |= {"families": list(families), "probability": p}
    found["shrink"] |= {"closed_by_effect": closed, "recalibrated": gap, "floor": 0.002}
    return found


@pytest.mark.parametrize(
    ("verdict", "port", "family"),
    [
        (said("effect", "tyre_radial/stiffness"), True, True),
        (said("effect", "tyre_radial/damping"), True, False),
        (said("effect", "road/stiffness"), False, False),
        (said("unknown", ports=["tyre_radial"]), True, False),
        (said("unknown", "tyre_radial/stiffness"), True, False),
        (said("none"), False, False),
        (said("several", "tyre_radial/stiffness", "rail/friction"), False, False),
        (said("effect", ports=["tyre_radial"]), True, False),
        (failed("no good"), False, False),
    ],
)
def test_port_and_family_are_right_only_alone(verdict: dict[str, Any], port: bool, family: bool) -> None:
    score = score_of(foreign("tyre_cubic"), verdict, "abc1234")
    assert (score.port_right, score.family_right) == (port, family)
    assert is_right(score) is family
    assert (score.named_right, score.located_right, score.unknown_recognised) == (None, None, None)
    assert score.version == "abc1234"
    assert score.foreign


def test_a_right_port_may_be_listed_beside_the_one_that_is_named() -> None:
    score = score_of(foreign("strut_buffer"), said("unknown", ports=["suspension"], beside=["strut"]))
    assert (score.port_right, score.port_listed, score.family_right) == (False, True, False)
    assert not said_right(score)
    assert score_of(foreign("strut_buffer"), said("none", beside=["strut"])).port_listed is False


def test_a_port_where_the_law_itself_does_the_same_counts_if_the_verdict_says_so() -> None:
    truth, verdict = foreign("joint_smooth"), said("effect", "strut/friction", beside=["suspension"])
    assert port_in_question(truth, verdict) == "strut"
    not_looked_at = score_of(truth, verdict)
    assert (not_looked_at.port_right, not_looked_at.family_right) == (False, False)
    alike = score_of(truth, verdict, elsewhere=0.7)
    assert (alike.port_right, alike.family_right, is_right(alike)) == (True, True, True)
    # Strictly, and for its stated probability, it is wrong.
    assert (alike.port_exactly, alike.family_exactly, said_right(alike)) == (False, False, False)
    distinct = score_of(truth, verdict, elsewhere=12.0)
    assert (distinct.port_right, distinct.family_right) == (False, False)
    other_kind = score_of(truth, said("effect", "strut/damping", beside=["suspension"]), elsewhere=0.7)
    assert (other_kind.port_right, other_kind.family_right) == (True, False)
    rates = rates_of([alike, distinct])
    assert (rates["port_right"].count, rates["port_exactly"].count) == (1, 0)
    assert (rates["family_right"].count, rates["family_exactly"].count) == (1, 0)


@pytest.mark.parametrize(
    "verdict",
    [
        said("effect", "strut/friction"),
        said("effect", "suspension/friction", beside=["strut"]),
        said("none", beside=["suspension"]),
        said("several", "strut/friction", "rail/friction", beside=["suspension"]),
    ],
)
def test_no_port_is_in_question_where_it_is_right_or_the_right_one_is_not_listed(
    verdict: dict[str, Any],
) -> None:
    truth = foreign("joint_smooth")
    assert port_in_question(truth, verdict) is None
    assert score_of(truth, verdict, elsewhere=0.7) == replace(score_of(truth, verdict), elsewhere=0.7)


@pytest.mark.parametrize(("in_the_draw", "gap"), [(True, 0.01), (False, 0.0032)])
def test_what_calibration_hides_may_be_left_alone_and_not_be_put_elsewhere(
    in_the_draw: bool, gap: float
) -> None:
    """By the draw, or because 0.25 % of the response is left beyond the noise."""
    hidden = replace(foreign("strut_digressive"), hidden=in_the_draw)
    alone = score_of(hidden, said("none", closed=None, gap=gap))
    assert (alone.port_right, alone.family_right, is_right(alone), said_right(alone)) == (
        None,
        None,
        True,
        True,
    )
    wrong = score_of(hidden, said("effect", "suspension/friction", gap=gap))
    assert (wrong.port_right, wrong.family_right, is_right(wrong)) == (False, False, False)
    right = score_of(hidden, said("effect", "strut/damping", closed=0.4, gap=gap))
    assert (right.port_right, right.family_right) == (True, True)
    rates = rates_of([alone, wrong, right])
    assert (rates["hidden_left_alone"].count, rates["hidden_left_alone"].total) == (1, 3)
    assert (verdict_of(alone), verdict_of(right)) == (LEFT_ALONE, truth_of(right))
    (axes,) = confusion_figure([alone, wrong]).axes
    columns = [label.get_text() for label in axes.get_xticklabels()]
    blue = {
        columns[round(cell.get_x() + 0.5)]: cell.get_facecolor()[2] > cell.get_facecolor()[0]
        for cell in axes.patches
    }
    assert blue == {LEFT_ALONE: True, verdict_of(wrong): False}
    assert (rates["port_right"].count, rates["port_right"].total) == (1, 2)
    assert rates["closed_by_effect_90"].total == 2
    assert median_closed([alone, right]) == 0.4
    assert not is_right(score_of(foreign("strut_digressive"), said("none")))


def test_what_shows_in_held_out_tests_is_not_hidden() -> None:
    """0.4 % of the response is left beyond the noise, more than the 0.3 % that matter."""
    score = score_of(foreign("strut_digressive"), said("none", closed=None, gap=0.0045))
    assert (score.hidden, score.port_right, is_right(score)) == (False, False, False)


def test_what_swings_on_the_body_may_be_put_at_the_masses() -> None:
    truth = foreign("body_hardening_oscillator")
    assert score_of(truth, said("effect", "inertia/oscillator")).family_right is True
    mass = score_of(truth, said("effect", "inertia/number"))
    assert (mass.port_right, mass.family_right) == (True, False)


def test_that_a_foreign_effect_is_unknown_at_its_port_is_true() -> None:
    truth = foreign("tyre_cubic")
    assert said_right(score_of(truth, said("unknown", ports=["tyre_radial"])))
    assert not said_right(score_of(truth, said("unknown", ports=["road"])))
    assert not said_right(score_of(truth, said("effect", "tyre_radial/damping")))


def test_something_said_where_only_small_errors_are_is_a_false_alarm() -> None:
    assert score_of(NOTHING, said("none")).false_alarm is False
    assert score_of(NOTHING, said("unknown", ports=["rail"])).false_alarm is True


def test_intervals_are_those_of_parameters_that_have_a_meaning() -> None:
    given = {
        "mu_r": {"lo": 0.029, "hi": 0.031},
        "c_sd": {"lo": 5000.0, "hi": 5100.0},
        "k_sd": {"lo": 0.0, "hi": 1.0},
    }
    verdict = said("effect", "tyre_radial/stiffness") | {"intervals": given}
    held = score_of(foreign("tyre_cubic"), verdict).intervals
    assert {name: each.holds for name, each in held.items()} == {"mu_r": True, "c_sd": False}
    # Friction at the rail is the rail's friction, whatever its law.
    assert set(score_of(foreign("rail_dahl"), verdict).intervals) == {"c_sd"}
    assert set(score_of(NOTHING, verdict).intervals) == {"mu_r", "c_sd"}
    assert score_of(answer("none"), verdict).intervals == {}


def test_marks_of_versions_that_did_not_look_at_other_ports_are_strict() -> None:
    for verdict in (said("effect", "tyre_radial/stiffness"), said("effect", "road/stiffness")):
        score = score_of(foreign("tyre_cubic"), verdict)
        older = asdict(score)
        for name in ("port_exactly", "family_exactly", "elsewhere"):
            del older[name]
        read = score_from(json.loads(json.dumps(older)))
        assert read == score
        assert said_right(read) == said_right(score)


def test_marks_are_read_as_they_are_written() -> None:
    score = score_of(foreign("rail_lugre"), said("effect", "rail/friction"), "v1")
    assert score_from(json.loads(json.dumps(asdict(score)))) == score
    older = asdict(score_of(answer("none"), diagnosis("none")))
    for name in ("foreign", "families", "sigmas", "port_right", "family_right", "probability", "version"):
        del older[name]
    assert score_from(json.loads(json.dumps(older))).probability is None
    with pytest.raises(ValueError, match="about something unknown"):
        score_from(json.loads(json.dumps(asdict(replace(score, effects=("strange",))))))


def scores() -> list[Score]:
    """Five foreign trials: two families right, three ports, one false alarm."""
    pairs = [
        (foreign("tyre_cubic", 1), said("effect", "tyre_radial/stiffness", closed=0.98, p=0.95)),
        (foreign("rail_dahl", 2), said("effect", "rail/friction", closed=0.9, p=0.8)),
        (foreign("rail_drag", 3), said("unknown", ports=["rail"], closed=0.2, p=0.6)),
        (replace(NOTHING, number=4), said("none", closed=None, p=0.999)),
        (replace(NOTHING, number=5), said("unknown", ports=["rail"], p=1.0)),
    ]
    return [score_of(truth, verdict, "abc") for truth, verdict in pairs]


def test_rates_of_foreign_trials_are_their_own() -> None:
    rates = rates_of(scores())
    counts = {name: (rate.count, rate.total) for name, rate in rates.items()}
    assert counts["port_right"] == (3, 3)
    assert counts["family_right"] == (2, 3)
    assert counts["false_alarms"] == (1, 2)
    assert counts["closed_by_effect_90"] == (2, 3)
    assert (rates["port_right"].least, rates["family_right"].least) == (0.92, 0.88)
    assert rates["false_alarms"].most == 0.01
    assert median_closed(scores()) == 0.9
    assert median_closed([]) is None
    confusion = confusion_of(scores(), tuple(FOREIGN))
    assert confusion.counts.trace() == 3


def _stating(*pairs: tuple[float, bool]) -> list[Score]:
    """Verdicts of trials with nothing, of a stated probability, true or not."""
    return [
        score_of(replace(NOTHING, number=n), said("none" if true else "unknown", ports=["rail"], p=p))
        for n, (p, true) in enumerate(pairs)
    ]


def test_the_calibration_error_of_known_numbers() -> None:
    """Ten of 0.8, of which six are true, and ten of 0.95, all true: (10 x 0.2 + 10 x 0.05) / 20."""
    stated = _stating(*[(0.8, k < 6) for k in range(10)], *[(0.95, True)] * 10)
    found = reliability_of(stated)
    assert found.error == pytest.approx(0.125)
    filled = {(each.low, each.high): each for each in found.bins if each.rate.total}
    assert set(filled) == {(0.7, 0.9), (0.9, 0.99)}
    assert filled[(0.7, 0.9)].stated == pytest.approx(0.8)
    assert filled[(0.7, 0.9)].rate.rate == 0.6
    assert filled[(0.9, 0.99)].rate.rate == 1.0


def test_every_stated_probability_is_in_one_bin() -> None:
    stated = [(p, True) for p in (*EDGES, 0.3, 0.6, 0.95, 0.995)]
    found = reliability_of(_stating(*stated))
    assert sum(each.rate.total for each in found.bins) == len(stated)
    assert [each.rate.total for each in found.bins] == [3, 2, 1, 2, 2]


def _tree(kind: str, *families: str, **shares: float) -> dict[str, Any]:
    """A diagnosis that states ``shares`` of learned laws at two ports and of a formula."""
    found = said(kind, *families, p=shares["law"])
    found["which"] = [
        {
            "effects": ["tyre_stiffening"],
            "port": "tyre_radial",
            "family": "stiffness",
            "probability": shares["law"],
        },
        {"effects": [], "port": "tyre_radial", "family": "stiffness", "probability": shares["learned"]},
        {"effects": [], "port": "tyre_radial", "family": "damping", "probability": shares["damping"]},
        {"effects": [], "port": "road", "family": "compliance", "probability": shares["road"]},
    ]
    ports = {"tyre_radial": shares["law"] + shares["learned"] + shares["damping"], "road": shares["road"]}
    found["where"] = {"ports": [{"port": name, "probability": each} for name, each in ports.items()]}
    return found


def test_ports_families_and_laws_state_what_is_below_them() -> None:
    verdict = _tree("effect", "tyre_radial/stiffness", law=0.5, learned=0.2, damping=0.1, road=0.2)
    verdict["verdict"]["effects"] = ["tyre_stiffening"]
    score = score_of(foreign("tyre_cubic"), verdict)
    stated = {each.level: (each.probability, each.true) for each in score.statements}
    assert {level: true for level, (_, true) in stated.items()} == {
        "port": True,
        "family": True,
        "law": False,
    }
    assert {level: p for level, (p, _) in stated.items()} == pytest.approx(
        {"port": 0.8, "family": 0.7, "law": 0.5}
    )
    levels = reliability_by_level([score])
    assert {level: each.error for level, each in levels.items()} == pytest.approx(
        {"port": 0.2, "family": 0.3, "law": 0.5}
    )
    # A learned law is no formula that is known; a wrong port states its probability all the same.
    verdict["verdict"] |= {"law_known": False, "ports": ["road"], "families": ["road/compliance"]}
    wrong = score_of(foreign("tyre_cubic"), verdict).statements
    assert [(each.level, each.true) for each in wrong] == [("port", False), ("family", False)]
    assert [each.probability for each in wrong] == pytest.approx([0.2, 0.2])
    panels = reliability_figure([score]).axes
    assert [each.get_ylabel().split()[2] for each in panels] == ["verdicts", "ports", "families", "laws"]


def test_verdicts_without_a_probability_and_failures_are_left_out() -> None:
    assert reliability_of([]).error is None
    left = [score_of(answer("none"), diagnosis("none")), score_of(NOTHING, failed("no good"))]
    assert reliability_of(left).error is None


def test_what_people_read_has_the_same_numbers() -> None:
    record = blind_record(scores(), {"foreign": True}, ("savgs-ident", "blind", "--foreign"))
    assert record["kinds"]["foreign"] == 3
    assert record["median_closed_by_effect"] == 0.9
    assert record["code"] == ["abc"]
    assert sum(each["of"] for each in record["reliability"]["bins"]) == 5
    assert record["reliability"]["calibration_error"] == pytest.approx(reliability_of(scores()).error)
    page = blind_html(scores(), {"foreign": True}, ())
    assert "Median share of the recalibrated gap that is closed: 90.0 %" in page
    assert "tyre_cubic (foreign law)" in page
    axes, *_ = reliability_figure(scores()).axes
    assert axes.get_xlabel() == "stated probability [1]"
    assert {text.get_text() for text in axes.texts} == {"1", "2"}
    assert blind_text(scores())


def test_a_certainty_that_rounding_made_more_than_one_is_counted() -> None:
    wrong = score_of(foreign("tyre_cubic"), said("unknown", ports=["road"], p=1.0000000000000016))
    found = reliability_of([wrong])
    assert [each.rate.total for each in found.bins] == [0, 0, 0, 0, 1]
    assert found.error == 1.0
