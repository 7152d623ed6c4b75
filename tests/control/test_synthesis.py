"""H-infinity synthesis: it keeps what it promises, nobody does better, and what is not regular is refused."""

from collections.abc import Callable

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from savgs_ident.control.generalised_plant import COMMAND, MEASUREMENTS
from savgs_ident.control.synthesis import (
    PRECISION,
    SLACK,
    Synthesis,
    largest_gain,
    singular_values,
    synthesise_hinf,
)
from savgs_ident.control.weights import DEFAULT_WEIGHTS
from savgs_ident.core.errors import InputError

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


@settings(max_examples=6)
@given(factor=st.floats(0.2, 5.0))
def test_gamma_grows_with_all_disturbances_alike(
    plant_with: Plant, synthesis: Synthesis, factor: float
) -> None:
    names = ("road_velocity", "drift", "noise_accel", "noise_deflection", "noise_position")
    louder = synthesise_hinf(plant_with(**{name: factor * WEIGHT[name] for name in names}))
    assert louder.gamma_least == pytest.approx(factor * synthesis.gamma_least, rel=2.0 * PRECISION)


@settings(max_examples=8)
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


@settings(max_examples=30)
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
