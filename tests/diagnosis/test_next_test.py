"""Tests that would distinguish two hypotheses."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.diagnosis.dwell_problem import DwellProblem
from savgs_ident.diagnosis.next_test import next_tests, predicted
from savgs_ident.diagnosis.result import Hypothesis
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.inference.find_map import find_map
from savgs_ident.inference.laplace_fit import LaplaceFit, Search, search_of
from savgs_ident.inference.observations import Data
from savgs_ident.plants.base import OperatingCondition
from savgs_ident.plants.quarter_car.plant import CHANNELS
from savgs_ident.simulate.periodic import PeriodicSolution

Fitted = tuple[Search, DwellProblem, LaplaceFit, LaplaceFit]

ACCELERATION, DEFLECTION = map([each.name for each in CHANNELS].index, ("sprung_accel", "susp_deflection"))


def _harmonics(
    plant: DwellProblem, mode: LaplaceFit, condition: OperatingCondition
) -> NDArray[np.complex128]:
    """Of both channels, (tests, channels, orders)."""
    found = predicted(plant, mode, condition)
    assert found.solved
    return plant.likelihood.harmonics(found.rows[None], plant.shape)[0]


@pytest.fixture(scope="module")
def fitted(plant_and_data: tuple[DwellProblem, Data], start: PeriodicSolution) -> Fitted:
    """A softer spring, explained by a softer spring and by softer bushings."""
    plant, data = plant_and_data
    term = {each.name: each for each in plant.candidates}
    (softer,) = term["spring_rate"].amplitudes
    truth = plant.predict(("spring_rate",), {softer.name: -0.06}, [softer.name], start)
    noise = np.sqrt(data.variance) * np.random.default_rng(5).standard_normal(truth.rows.size)
    search = search_of(plant, replace(data, measured=truth.rows + noise))
    modes = [find_map(search, (term[name],), {}, start) for name in ("spring_rate", "bushing_stiffness")]
    return search, plant, modes[0], modes[1]


@pytest.mark.slow
def test_the_most_significant_tests_are_proposed_with_their_dwells(fitted: Fitted) -> None:
    search, plant, one, other = fitted
    found = next_tests(search, plant, one, other)
    assert len(found) == DEFAULTS.proposed_tests
    assert [each.expected_sigma for each in found] == sorted((e.expected_sigma for e in found), reverse=True)
    for each in found:
        assert each.separates == (Hypothesis(("spring_rate",)), Hypothesis(("bushing_stiffness",)))
        assert each.test.startswith("dwells at ")
        assert sum(each.test.endswith(condition.text) for condition in plant.plant.conditions) == 1
        assert each.expected_sigma > 0.0


@pytest.mark.slow
def test_no_test_distinguishes_a_hypothesis_from_itself(fitted: Fitted) -> None:
    search, plant, one, _ = fitted
    assert all(each.expected_sigma < 1e-6 for each in next_tests(search, plant, one, one))


@pytest.mark.slow
def test_a_link_that_swings_while_the_road_stands_still_moves_the_body_as_its_strut_pushes(
    fitted: Fitted,
) -> None:
    """Twice the swing is nearly twice the motion, and nothing moves without it."""
    _, plant, one, _ = fitted
    small, large = (
        plant.likelihood.harmonics(
            predicted(plant, one, OperatingCondition("", 0.0, swings={"link_angle": swing})).rows[None],
            plant.shape,
        )[0]
        for swing in (0.1, 0.2)
    )
    for channel in (ACCELERATION, DEFLECTION):
        ratio = np.abs(large[:, channel, 1]) / np.abs(small[:, channel, 1])
        assert np.all((ratio > 1.8) & (ratio < 2.6))
    assert not predicted(plant, one, OperatingCondition("", 0.0)).solved


@pytest.mark.slow
def test_at_half_the_lift_the_rail_holds_the_body_in_slow_tests(fitted: Fitted) -> None:
    """Its acceleration falls by more than the lift, the more so the slower the test."""
    _, plant, one, _ = fitted
    whole, half = (_harmonics(plant, one, OperatingCondition("", lift)) for lift in (1.0, 0.5))
    share = np.abs(half[:, ACCELERATION, 1]) / np.abs(whole[:, ACCELERATION, 1])
    assert np.all(share < 0.5)
    assert np.all(np.diff(share) > 0.0)
