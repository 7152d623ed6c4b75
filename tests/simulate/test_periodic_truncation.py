"""How good default nodes are."""

import numpy as np
import pytest

from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.simulate.periodic import PeriodicSolution

from .programme import distance, finer, orders


@pytest.fixture(scope="module")
def actual(friction: QuarterCar, numbers: Values, programme: PeriodicSolution) -> np.ndarray:
    """Distance to a solution on eight times as many nodes, whose own error is a fortieth of it, (28, 2)."""
    solution = finer(friction, numbers, programme, 8)
    assert all(status.ok for status in solution.status())
    return distance(orders(friction, numbers, programme), orders(friction, numbers, solution))


@pytest.mark.slow
def test_every_dwell_converges_from_a_cold_start(programme: PeriodicSolution) -> None:
    assert [status.name for status in programme.status()] == ["CONVERGED"] * 28


@pytest.mark.slow
def test_default_nodes_are_good_to_a_thousandth_of_the_first_harmonic(actual: np.ndarray) -> None:
    assert np.max(actual) < 1e-3
