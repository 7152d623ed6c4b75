"""H-infinity synthesis, its check, and the controller as a computer runs it."""

from collections.abc import Callable

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.control.generalised_plant import COMMAND, DEFAULT_WEIGHTS, MEASUREMENTS
from savgs_ident.control.synthesis import (
    PRECISION,
    SLACK,
    Synthesis,
    discretise,
    largest_gain,
    reduce_order,
    singular_values,
    synthesise_hinf,
)
from savgs_ident.core.errors import InputError

from ..in_one_test import over
from .glover_doyle import exists

Plant = Callable[..., control.StateSpace]
WEIGHT = DEFAULT_WEIGHTS.as_dict()
OPEN = 2j * np.pi


def test_the_sweep_confirms_gamma(synthesis: Synthesis) -> None:
    assert synthesis.holds
    assert np.all(synthesis.closed.poles().real < 0.0)
    assert synthesis.gamma == pytest.approx(SLACK * synthesis.gamma_least)
    # Nobody gets below the least gamma, this controller neither.
    assert (1.0 - 2.0 * PRECISION) * synthesis.gamma_least <= synthesis.peak <= synthesis.gamma
    assert synthesis.peak == pytest.approx(control.linfnorm(synthesis.closed)[0], rel=1e-6)


def test_the_closed_loop_is_the_plant_with_its_controller(plant_with: Plant, synthesis: Synthesis) -> None:
    assert tuple(synthesis.controller.input_labels) == MEASUREMENTS
    assert synthesis.controller.output_labels == [COMMAND]
    for frequency in (1e-3, 0.2, 2.0, 15.0, 200.0):
        plant, law = plant_with()(OPEN * frequency), synthesis.controller(OPEN * frequency)
        seen = np.linalg.solve(np.eye(3) - plant[4:, 5:] @ law, plant[4:, :5])
        wanted = plant[:4, :5] + plant[:4, 5:] @ law @ seen
        found = synthesis.closed(OPEN * frequency)
        assert found == pytest.approx(wanted, abs=1e-7 * np.abs(wanted).max())


@pytest.mark.parametrize(
    "changed",
    [{}, {"accel_bound": 1.0}, {"noise_accel": 1.0, "noise_position": 1e-3}, {"drift": 1e-2}],
    ids=["shipped", "less acceleration", "noisy", "drifting"],
)
def test_the_least_gamma_is_where_the_riccati_equations_cease_to_have_solutions(
    plant_with: Plant, changed: dict[str, float]
) -> None:
    plant = plant_with(**changed)
    least = synthesise_hinf(plant).gamma_least
    assert exists(plant, least * 1.001, len(MEASUREMENTS))
    assert not exists(plant, least * (1.0 - 2.0 * PRECISION), len(MEASUREMENTS))


@given(factor=st.floats(0.2, 5.0))
def test_gamma_grows_with_all_disturbances_alike(
    plant_with: Plant, synthesis: Synthesis, factor: float
) -> None:
    names = ("road_velocity", "drift", "noise_accel", "noise_deflection", "noise_position")
    louder = synthesise_hinf(plant_with(**{name: factor * WEIGHT[name] for name in names}))
    assert louder.gamma_least == pytest.approx(factor * synthesis.gamma_least, rel=2.0 * PRECISION)


@given(
    name=st.sampled_from([each for each in WEIGHT if not each.endswith("corner")]), factor=st.floats(1.5, 4.0)
)
def test_whoever_asks_for_less_gets_a_lower_gamma(
    plant_with: Plant, synthesis: Synthesis, name: str, factor: float
) -> None:
    easier = factor if name.endswith("bound") else 1.0 / factor
    found = synthesise_hinf(plant_with(**{name: easier * WEIGHT[name]}))
    assert found.holds
    assert found.gamma_least <= synthesis.gamma_least * (1.0 + PRECISION)


@pytest.mark.parametrize("name", ["noise_accel", "noise_deflection", "noise_position", "drift"])
def test_without_a_noise_or_the_drift_there_is_no_design(plant_with: Plant, name: str) -> None:
    with pytest.raises(InputError, match="no controller reaches") as caught:
        synthesise_hinf(plant_with(**{name: 0.0}))
    assert "noise" in caught.value.remedy


def test_a_command_that_costs_nothing_is_refused(plant_with: Plant) -> None:
    plant = plant_with()
    plant.D[:4, 5] = 0.0
    with pytest.raises(InputError, match="no controller reaches"):
        synthesise_hinf(plant)


@given(log_frequency=st.floats(-3.0, 3.0), damping=st.floats(1e-4, 0.6))
def test_the_largest_gain_of_a_resonance_is_known(log_frequency: float, damping: float) -> None:
    natural = 2.0 * np.pi * 10.0**log_frequency
    system = control.ss(
        [[0.0, natural], [-natural, -2.0 * damping * natural]], [[0.0], [natural]], [[1.0, 0.0]], 0.0
    )
    gain, at = largest_gain(system)
    assert gain == pytest.approx(1.0 / (2.0 * damping * np.sqrt(1.0 - damping**2)), rel=1e-6)
    assert at == pytest.approx(10.0**log_frequency * np.sqrt(1.0 - 2.0 * damping**2), rel=1e-3)


def test_the_largest_gain_of_many_signals_is_the_norm(plant_with: Plant, synthesis: Synthesis) -> None:
    """Two algorithms: a sweep with refinement, and bisection on a Hamiltonian."""
    for system in (synthesis.closed, synthesis.controller):
        assert largest_gain(system)[0] == pytest.approx(control.linfnorm(system)[0], rel=1e-6)


def test_singular_values_hold_the_power_of_the_response(synthesis: Synthesis) -> None:
    frequency = np.array([0.01, 0.5, 2.0, 30.0])
    values = singular_values(synthesis.closed, frequency)
    assert np.all(np.diff(values, axis=1) <= 0.0)
    for f, row in zip(frequency, values, strict=True):
        response = synthesis.closed(OPEN * f)
        assert np.sum(row**2) == pytest.approx(np.sum(np.abs(response) ** 2), rel=1e-12)


FREQUENCY = np.geomspace(1e-3, 1e3, 300)


@given(rate=st.floats(200.0, 2e4), place=st.floats(0.001, 0.95))
def test_sampling_by_the_bilinear_rule_only_bends_the_frequency(
    synthesis: Synthesis, rate: float, place: float
) -> None:
    """z = exp(i w T) stands for s = (2i/T) tan(w T/2): nothing else may change."""
    turn = place * np.pi
    warped = 2j * rate * np.tan(turn / 2.0)
    found, wanted = discretise(synthesis.controller, rate)(np.exp(1j * turn)), synthesis.controller(warped)
    assert np.abs(found - wanted).max() < 1e-7 * np.abs(wanted).max()


def test_the_sampled_controller_keeps_names_rate_static_gain_and_stability(synthesis: Synthesis) -> None:
    found = discretise(synthesis.controller, 500.0)
    assert (found.input_labels, found.output_labels) == (
        synthesis.controller.input_labels,
        synthesis.controller.output_labels,
    )
    assert found.dt == 1.0 / 500.0
    assert found.dcgain() == pytest.approx(synthesis.controller.dcgain(), rel=1e-8)
    assert np.all(synthesis.controller.poles().real < 0.0)
    assert np.all(np.abs(found.poles()) < 1.0)


def test_a_controller_of_its_full_order_stays_as_it_is(synthesis: Synthesis) -> None:
    full = synthesis.controller
    same = reduce_order(full, full.nstates)
    iw = 2j * np.pi * FREQUENCY
    assert np.abs(same(iw) - full(iw)).max() < 1e-8 * np.abs(full(iw)).max()


@over("order", [1, 4, 6, 8, 9])
def test_a_reduced_controller_keeps_its_static_gain_and_loses_no_more_than_the_hankel_tail(
    synthesis: Synthesis, order: int
) -> None:
    """Glover's bound: twice the sum of the Hankel singular values that were dropped."""
    full = synthesis.controller
    reduced = reduce_order(full, order)
    assert reduced.nstates == order
    assert reduced.dcgain() == pytest.approx(full.dcgain(), rel=1e-6, abs=1e-8)
    assert (reduced.input_labels, reduced.output_labels) == (full.input_labels, full.output_labels)
    tail = 2.0 * np.sum(np.sort(control.hankel_singular_values(full))[::-1][order:])
    iw = 2j * np.pi * FREQUENCY
    difference = np.linalg.norm(reduced(iw) - full(iw), axis=(0, 1))
    assert np.max(difference) <= tail * (1.0 + 1e-6)


@pytest.mark.parametrize("order", [-1, 0, 11])
def test_an_order_that_is_not_there_is_refused(synthesis: Synthesis, order: int) -> None:
    assert synthesis.controller.nstates == 10
    with pytest.raises(InputError, match=f"cannot be reduced to {order}") as caught:
        reduce_order(synthesis.controller, order)
    assert "between 1 and 10" in caught.value.remedy


@pytest.mark.parametrize("pole", [0.0, 1.0])
def test_an_unstable_controller_is_not_reduced(pole: float) -> None:
    unstable = control.ss(np.diag([pole, -2.0]), np.ones((2, 3)), np.ones((1, 2)), np.zeros((1, 3)))
    with pytest.raises(InputError, match="unstable"):
        reduce_order(unstable, 1)
