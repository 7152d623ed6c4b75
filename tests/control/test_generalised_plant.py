"""The generalised plant: every path is the product of its parts, and the problem is regular."""

from collections.abc import Callable

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from savgs_ident.control.generalised_plant import (
    COMMAND,
    COMMAND_ROLL_OFF,
    DISTURBANCES,
    MEASUREMENTS,
    PENALTIES,
    actuator,
    design_loop,
)
from savgs_ident.control.weights import DEFAULT_WEIGHTS

Plant = Callable[..., control.StateSpace]

WEIGHT = DEFAULT_WEIGHTS.as_dict()
OPEN = 2j * np.pi


def _lag(frequency: float, corner: float) -> complex:
    return 1.0 / (1.0 + 1j * frequency / corner)


def _by_hand(space: control.StateSpace, bandwidth: float, frequency: float) -> NDArray[np.complex128]:
    """Outputs (7,) by inputs (6,), from eq. (8)'s response and the formulas of weights and drive."""
    road, lin = space(OPEN * frequency).T
    drive = _lag(frequency, bandwidth)
    accel, deflection, position = (
        np.array([road[row] * WEIGHT["road_velocity"], lin[row] * WEIGHT["drift"], lin[row] * drive])
        for row in (0, 1, 3)
    )
    turned = frequency / WEIGHT["command_corner"]
    lead = (1.0 + 1j * turned) / (1.0 + 1j * turned / COMMAND_ROLL_OFF)
    out = np.zeros((7, 6), complex)
    from_rig = (0, 1, 5)
    for row, (name, signal) in enumerate(
        (("accel", accel), ("deflection", deflection), ("position", position))
    ):
        out[row, from_rig] = signal * _lag(frequency, WEIGHT[f"{name}_corner"]) / WEIGHT[f"{name}_bound"]
        out[4 + row, from_rig] = signal
        out[4 + row, 2 + row] = WEIGHT[f"noise_{name}"]
    out[3, 5] = lead / WEIGHT["command_bound"]
    return out


@given(frequency=st.floats(-3.0, 2.5).map(lambda log: 10.0**log))
def test_every_path_is_the_product_of_its_parts(
    plant_with: Plant, space: control.StateSpace, bandwidth: float, frequency: float
) -> None:
    found, wanted = plant_with()(OPEN * frequency), _by_hand(space, bandwidth, frequency)
    assert found == pytest.approx(wanted, rel=1e-9, abs=1e-12 * np.abs(wanted).max())


def test_its_signals_are_those_of_figure_9(plant_with: Plant) -> None:
    plant = plant_with()
    assert tuple(plant.input_labels) == (*DISTURBANCES, COMMAND)
    assert tuple(plant.output_labels) == (*PENALTIES, *MEASUREMENTS)


def test_command_and_measurements_are_weighed_and_disturbed_at_infinite_frequency(plant_with: Plant) -> None:
    """D12 and D21 have full rank, D11 and D22 are zero: what the Riccati equations ask for."""
    d, last = plant_with().D, len(PENALTIES)
    assert np.linalg.matrix_rank(d[:last, -1:]) == 1
    assert np.linalg.matrix_rank(d[last:, :-1]) == len(MEASUREMENTS)
    assert not d[:last, :-1].any()
    assert not d[last:, -1:].any()


def test_it_can_be_stabilised_and_all_that_is_unstable_is_seen(plant_with: Plant) -> None:
    """The integrator from velocity to z_lin: disturbed, commanded, weighed and measured."""
    plant = plant_with()
    unstable = [pole for pole in plant.poles() if pole.real > -1e-9]
    assert np.abs(unstable) == pytest.approx(0.0, abs=1e-9)
    last = len(PENALTIES)
    for pole in unstable:
        turned = plant.A - pole * np.eye(plant.nstates)
        for inputs in (plant.B[:, :-1], plant.B[:, -1:]):
            assert np.linalg.svd(np.hstack([turned, inputs]), compute_uv=False)[-1] > 1e-6
        for outputs in (plant.C[:last], plant.C[last:]):
            assert np.linalg.svd(np.vstack([turned, outputs]), compute_uv=False)[-1] > 1e-6


@pytest.mark.parametrize("name", ["accel", "deflection", "position"])
def test_a_weight_is_one_over_its_bound_below_its_corner_and_3_db_less_at_it(
    plant_with: Plant, space: control.StateSpace, name: str
) -> None:
    row, signal = {"accel": (0, 0), "deflection": (1, 1), "position": (2, 3)}[name]
    corner, bound = WEIGHT[f"{name}_corner"], WEIGHT[f"{name}_bound"]

    def weight(frequency: float) -> float:
        drifting = space(OPEN * frequency)[signal, 1] * WEIGHT["drift"]
        return float(np.abs(plant_with()(OPEN * frequency)[row, 1] / drifting))

    assert weight(corner / 300.0) == pytest.approx(1.0 / bound, rel=1e-4)
    assert weight(corner) == pytest.approx(1.0 / (bound * np.sqrt(2.0)), rel=1e-9)
    assert weight(100.0 * corner) == pytest.approx(1.0 / (100.0 * bound), rel=1e-4)


def test_the_drive_is_a_first_order_lag_of_its_bandwidth(bandwidth: float) -> None:
    assert bandwidth == pytest.approx(17.8)
    assert abs(actuator(bandwidth)(OPEN * bandwidth)) == pytest.approx(np.sqrt(0.5))
    assert actuator(bandwidth).dcgain() == pytest.approx(1.0)


@given(frequency=st.floats(-3.0, 2.5).map(lambda log: 10.0**log))
def test_the_loop_is_the_plant_from_command_to_measurements(
    plant_with: Plant, space: control.StateSpace, bandwidth: float, frequency: float
) -> None:
    loop = design_loop(space, bandwidth)
    assert (loop.input_labels, tuple(loop.output_labels)) == ([COMMAND], MEASUREMENTS)
    wanted = plant_with()(OPEN * frequency)[4:, 5]
    assert np.ravel(loop(OPEN * frequency)) == pytest.approx(wanted, rel=1e-7)
