"""Motions under two roads, in phase, against each other, and one alone: against a transfer matrix."""

import numpy as np
import pytest

import savgs_ident as si
from savgs_ident.core.values import as_values
from savgs_ident.simulate.excitation import sine_excitation
from savgs_ident.simulate.periodic import simulate_periodic
from savgs_ident.simulate.readings import harmonics
from tests.simulate.half_car import HERTZ, HalfCar, exact


@pytest.mark.parametrize(("front", "rear"), [(0.015, 0.015), (0.015, -0.015), (0.005, 0.0), (0.01, 0.02)])
def test_motions_under_two_roads_are_those_of_the_transfer_matrix(front: float, rear: float) -> None:
    plant, p = HalfCar(), as_values(HalfCar.parameters.as_dict())
    driven = {"road_front": front, "road_rear": rear}
    excitation = sine_excitation(plant, HalfCar.parameters, np.array(HERTZ), driven)
    solution = simulate_periodic(plant, p, excitation)
    assert all(status.ok for status in solution.status())
    found, expected = np.asarray(harmonics(plant, p, solution, 1))[:, :, 1], exact(front, rear)
    assert np.max(np.abs(found - expected)) < 3e-4 * np.max(np.abs(expected))


def test_a_plan_moves_both_roads() -> None:
    """In phase the body heaves, and pitches little: its inertia is known from roads against each other."""
    model = si.PlantModel(HalfCar(), HalfCar.parameters)
    planned = si.plan(model, frequencies=HERTZ, amplitudes=[0.01], tests=4)
    sides = {each.programme.beside.get("road_rear", 0.0) for each in planned.tests}
    assert {0.01, -0.01} & sides
    assert not any(each.programme.levels for each in planned.tests)
    assert planned.offered == 3 * len(HERTZ)
    # All scale with the mass, which is known to one per cent.
    assert planned.limited == ("J", "k_f", "c_f", "c_r")
    assert planned.errors["J"] == pytest.approx(0.01, rel=0.1)
