"""What is said and shown of false alarms."""

import json

import numpy as np

from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.report.present_validation import alarms_figure, alarms_record, alarms_text
from savgs_ident.validation.false_alarms import AlarmStudy, NullDraw


def _draws(count: int, alarms: int) -> list[NullDraw]:
    odds = np.random.default_rng(1).normal(-4.0, 1.0, count)
    quiet = [NullDraw(number, float(each), False, ()) for number, each in enumerate(odds[alarms:])]
    return [
        NullDraw(count + n, DEFAULTS.alarm_log_odds + 1.0, True, ("rail_viscous",)) for n in range(alarms)
    ] + quiet


def test_one_alarm_in_fifty_is_allowed() -> None:
    for alarms, right in ((0, True), (2, True), (3, False)):
        record = alarms_record(AlarmStudy(tuple(_draws(100, alarms)), -0.2))
        assert record["few_enough"] is right
        assert record["alarms"] == alarms
        assert record["named"] == [["rail_viscous"]] * alarms
        assert json.loads(json.dumps(record)) == record


def test_what_could_not_be_solved_is_reported_and_not_counted() -> None:
    record = alarms_record(AlarmStudy((*_draws(40, 0), NullDraw(40, None, False, ())), 812.0))
    assert (record["drawn"], record["not_solved"]) == (40, 1)
    text = alarms_text(record)
    assert "Of 40 campaigns like this one with nothing missing (1 more could not be solved)" in text
    assert "at most 7.2 %" in text
    assert "those of this campaign 812.0; the threshold of an alarm is 4" in text


def test_nothing_solved_is_nothing_shown() -> None:
    record = alarms_record(AlarmStudy((NullDraw(0, None, False, ()),), 1.0))
    assert record["few_enough"] is False
    assert "at most 100.0 %" in alarms_text(record)


def test_the_histogram_holds_all_draws_and_both_lines() -> None:
    (axes,) = alarms_figure(AlarmStudy(tuple(_draws(60, 0)), 900.0)).axes
    assert sum(patch.get_height() for patch in axes.patches) == 60
    assert "[nat]" in axes.get_xlabel()
    legend = [text.get_text() for text in axes.get_legend().get_texts()]
    assert "this campaign: 900, far to the right" in legend
