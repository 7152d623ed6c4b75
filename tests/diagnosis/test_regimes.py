"""Regimes: a misfit is found where it was put, and nowhere where there is none."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import binom

from savgs_ident.diagnosis.dwell_problem import dwell_problem
from savgs_ident.diagnosis.regimes import Cycles, find_regimes, holm
from savgs_ident.diagnosis.result import Regime
from savgs_ident.inference.find_map import find_map
from savgs_ident.inference.laplace_fit import LaplaceFit, search_of
from savgs_ident.inference.observations import Data
from savgs_ident.inference.prior import Scales
from savgs_ident.plants.two_mass import PARAMETERS, TwoMass
from savgs_ident.simulate.periodic import PeriodicSettings

from ..relaxed import as_users_have_it
from .fading_damper import ORDER, fading_campaign
from .toy import ToyPlant, draw

PLANT = ToyPlant()
NOISE, MISS = 0.01, 0.01
RECORDED = np.array([3.0, 0.0, 5.0, 1.0, 4.0, 2.0])
SPEED = PLANT.x.reshape(PLANT.tests, PLANT.points)


def _cycles(recorded: Sequence[float] | np.ndarray = RECORDED) -> Cycles:
    return Cycles(
        waves=lambda rows: rows.reshape(len(rows), PLANT.tests, 1, PLANT.points),
        velocity=SPEED,
        displacement=np.cos(7.0 * SPEED),
        frequency=np.arange(1.0, PLANT.tests + 1.0),
        recorded=np.asarray(recorded, float),
    )


def _fitted(data: Data) -> LaplaceFit:
    fit = find_map(search_of(PLANT, data), (), {}, None)
    assert fit.status.ok
    return fit


def _with(data: Data, change: np.ndarray) -> Data:
    return Data(data.measured + change, data.variance, data.discrepancy_scale, data.test)


def _significant(regimes: Sequence[Regime]) -> dict[str, float]:
    return {each.name: each.gap_percent for each in regimes if each.p_value < 0.05}


def test_a_misfit_at_high_speed_is_found_there_and_nowhere_else() -> None:
    sign = np.repeat([1.0, -1.0, 1.0, -1.0, 1.0, -1.0], PLANT.points)
    there = 0.04 * sign * np.where(np.abs(PLANT.x) > 0.66, np.cos(40.0 * PLANT.x), 0.0)
    data = _with(draw(PLANT, {"a": 1.1}, NOISE, seed=1), there)
    found = find_regimes(_cycles(), data, _fitted(data))
    assert list(_significant(found)) == ["high speed"]
    inside = np.abs(PLANT.x) > 0.66
    response = np.std(data.measured.reshape(PLANT.tests, -1), axis=1).mean()
    gap = 100.0 * np.sqrt(np.mean(there[inside] ** 2)) / response
    assert found[0].gap_percent == pytest.approx(gap, rel=0.2)
    assert next(each for each in found if each.name == "low speed").gap_percent < 0.3 * gap


def test_a_misfit_in_the_fast_tests_is_found_there() -> None:
    random = np.random.default_rng(4)
    there = np.where(
        np.arange(PLANT.x.size) >= 4 * PLANT.points, 0.05 * random.standard_normal(PLANT.x.size), 0.0
    )
    data = _with(draw(PLANT, {}, NOISE, seed=2), there)
    assert "fast tests" in _significant(find_regimes(_cycles(), data, _fitted(data)))


def test_a_slope_that_fades_is_found_as_a_drift() -> None:
    late = np.repeat(RECORDED - RECORDED.mean(), PLANT.points)
    data = _with(draw(PLANT, {}, NOISE, seed=3), -0.02 * late * PLANT.x)
    fit = _fitted(data)
    found = find_regimes(_cycles(), data, fit)
    assert _significant(found)["drift over time"] == pytest.approx(100.0 * 0.02 * np.std(RECORDED), rel=0.15)
    # In another order it would not be one; in that of the frequencies it could as well be something else.
    shuffled = find_regimes(_cycles([0.0, 1.0, 4.0, 5.0, 3.0, 2.0]), data, fit)
    assert "drift over time" not in _significant(shuffled)
    assert "drift over time or frequency" in [
        each.name for each in find_regimes(_cycles(range(6)), data, fit)
    ]


def test_a_slope_that_follows_a_temperature_is_found_as_a_drift_over_it() -> None:
    warm = np.array([31.0, 24.0, 28.0, 33.0, 22.0, 27.0])
    there = -0.02 * np.repeat(warm - warm.mean(), PLANT.points) * PLANT.x
    data = _with(draw(PLANT, {}, NOISE, seed=3), there)
    fit, cycles = _fitted(data), replace(_cycles(), beside={"oil": warm, "strain": np.full(6, np.nan)})
    found = _significant(find_regimes(cycles, data, fit))
    assert found["drift over oil"] == pytest.approx(100.0 * 0.02 * np.std(warm), rel=0.15)
    assert "drift over time" not in found
    assert not any("strain" in each.name for each in find_regimes(cycles, data, fit))
    # Where it only rises, it cannot be told from the time.
    rising = replace(cycles, beside={"oil": 20.0 + RECORDED})
    assert "drift over time or oil" in [each.name for each in find_regimes(rising, data, fit)]


@pytest.mark.slow
def test_data_of_the_error_model_have_no_regime_more_often_than_the_level_says() -> None:
    """Noise and discrepancy of the fitted sizes, a parameter from its prior: 200 campaigns, level 5 %."""
    alarms = 0
    for seed in range(200):
        slope = 1.0 + 0.2 * np.random.default_rng(1000 + seed).standard_normal()
        data = draw(PLANT, {"a": slope}, NOISE, seed, MISS)
        alarms += bool(_significant(find_regimes(_cycles(), data, _fitted(data), draws=399)))
    assert alarms <= binom.ppf(0.999, 200, 0.05)


def test_single_regimes_of_the_error_model_have_uniform_p_values() -> None:
    """Without the correction a regime is called at the level that is asked for, neither more nor less."""
    smallest = []
    for seed in range(200):
        data = draw(PLANT, {}, NOISE, 5000 + seed, MISS)
        found = find_regimes(_cycles(), data, _fitted(data), draws=199)
        smallest.append(found[0].p_value / len(found))
    low, high = binom.ppf([0.001, 0.999], 200, 1.0 - (1.0 - 0.02) ** len(found))
    assert low * 0.5 <= np.sum(np.array(smallest) <= 0.02) <= high


def test_errors_that_rows_share_are_a_regime_only_where_they_are_not_small() -> None:
    """A discrepancy that is concentrated by itself is expected to be, up to the size that its prior allows."""
    data = draw(PLANT, {}, NOISE, seed=6)
    bump = np.where(np.abs(PLANT.x) > 0.66, np.cos(40.0 * PLANT.x), 0.0)

    def found(width: float) -> dict[str, float]:
        shared = Data(
            data.measured + 0.03 * bump,
            data.variance,
            0.1 * data.discrepancy_scale,
            data.test,
            Scales(discrepancy=width),
            shared=bump[:, None],
        )
        return _significant(find_regimes(_cycles(), shared, _fitted(shared)))

    assert not found(0.05)
    assert "high speed" in found(0.002)


def test_instants_that_coincide_are_one_regime() -> None:
    phase = 2.0 * np.pi * (np.arange(PLANT.points) + 0.5) / PLANT.points
    angle = np.tile(phase, (PLANT.tests, 1))
    same = Cycles(
        _cycles().waves,
        np.cos(angle),
        np.sin(angle),
        _cycles().frequency,
        RECORDED,
        load=np.abs(np.cos(angle)),
    )
    data = draw(PLANT, {}, NOISE, seed=7)
    names = {each.name for each in find_regimes(same, data, _fitted(data), draws=19)}
    assert "high speed or small stroke or high load" in names
    assert "low speed or large stroke or low load" in names


def test_holm_corrects_the_smallest_by_all_and_keeps_the_order() -> None:
    """0.01 of four: 0.04; 0.02 of three: 0.06; 0.03 of two would be 0.06; 0.5 stays."""
    assert_allclose(holm(np.array([0.03, 0.01, 0.5, 0.02])), [0.06, 0.04, 0.5, 0.06])
    assert_allclose(holm(np.array([0.9, 0.6])), [1.0, 1.0])
    assert holm(np.array([])) == ()


def _regimes_of(damping: np.ndarray, oil: np.ndarray | None = None) -> dict[str, float]:
    """Those of the two masses in which the misfit is concentrated, recalibrated with the background."""
    response = replace(fading_campaign(damping, ORDER), beside={} if oil is None else {"oil": oil})
    settings = PeriodicSettings(nodes=64, adaptations=0)
    problem, data = dwell_problem(
        response, TwoMass(), PARAMETERS, {}, free=("k", "c"), orders=3, settings=settings
    )
    alone = find_map(search_of(problem, data), (), {}, problem.start({}))
    data = problem.with_background(data, alone.values, alone.prediction.warm_start)
    fit = find_map(search_of(problem, data), (), alone.values, alone.prediction.warm_start)
    return _significant(problem.regimes(data, fit))


@pytest.mark.slow
def test_a_damping_that_fades_over_the_campaign_is_found_as_a_drift() -> None:
    with as_users_have_it():
        fading = _regimes_of(PARAMETERS["c"].value * (1.1 - 0.2 * ORDER / 7.0))
        steady = _regimes_of(np.full(8, PARAMETERS["c"].value))
    assert "drift over time" in fading
    assert fading["drift over time"] > 1.0
    assert not steady


@pytest.mark.slow
def test_a_damping_that_follows_the_temperature_of_its_oil_is_found_as_a_drift_over_it() -> None:
    oil = np.array([25.0, 31.0, 22.0, 36.0, 28.0, 20.0, 33.0, 30.0])
    with as_users_have_it():
        found = _regimes_of(PARAMETERS["c"].value * (1.1 - 0.2 * (oil - 20.0) / 16.0), oil)
    assert found["drift over oil"] > 1.0
    assert "drift over time" not in found
