"""How often something is found where nothing is missing."""

import pytest
from scipy.stats import binom

from savgs_ident.diagnosis.public import AskedDwells
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.validation.false_alarms import CONFIDENCE, alarm_bench, rate_bound

from .conftest import COARSE, Measure


@pytest.mark.parametrize(("alarms", "drawn"), [(0, 60), (1, 100), (7, 30)])
def test_with_the_rate_at_its_bound_so_few_alarms_are_as_improbable_as_is_said(
    alarms: int, drawn: int
) -> None:
    bound = rate_bound(alarms, drawn)
    assert binom.cdf(alarms, drawn, bound) == pytest.approx(1.0 - CONFIDENCE)


def test_alarms_in_all_draws_or_no_draw_at_all_bound_nothing() -> None:
    assert rate_bound(5, 5) == rate_bound(0, 0) == 1.0


def _silent(line: str) -> None:
    del line


@pytest.mark.slow
def test_campaigns_with_nothing_missing_give_no_alarm_and_one_with_a_gap_does(
    measure_few: Measure, rig: Rig
) -> None:
    model = RigModel(rig, COARSE.baseline)
    nominal, lacking = (
        AskedDwells(measure_few(name), model, COARSE, {}, ()) for name in ("nominal", "stribeck_rail")
    )
    bench = alarm_bench(nominal, 3, _silent)
    draws = [bench.draw(number) for number in range(2)]
    assert not any(each.alarm for each in draws)
    assert all(each.odds is not None and each.odds < DEFAULTS.alarm_log_odds for each in draws)
    assert draws[1] != draws[0]
    with_a_gap = alarm_bench(lacking, 3, _silent)
    assert with_a_gap.odds > 10.0 * DEFAULTS.alarm_log_odds
