"""The generalised plant and its weights."""

from collections.abc import Callable
from pathlib import Path

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from savgs_ident.control.generalised_plant import (
    COMMAND,
    COMMAND_ROLL_OFF,
    DEFAULT_WEIGHTS,
    DISTURBANCES,
    MEASUREMENTS,
    PENALTIES,
    actuator,
    design_loop,
    read_weights,
)
from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable

from ..in_one_test import over

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


NAMES = tuple(DEFAULT_WEIGHTS)
TEXT = "".join(
    f'{each.name} = {{ value = {each.value}, unit = "{each.unit}" }}\n' for each in DEFAULT_WEIGHTS.entries
)


def _read(path: Path, text: str) -> ParameterTable:
    path.write_bytes(text.encode(errors="replace"))
    return read_weights(path)


def test_a_file_of_all_the_weights_that_come_along_changes_nothing(tmp_path: Path) -> None:
    assert _read(tmp_path / "weights.toml", TEXT) == DEFAULT_WEIGHTS
    assert _read(tmp_path / "weights.toml", "") == DEFAULT_WEIGHTS


@given(name=st.sampled_from(NAMES), value=st.floats(1e-2, 1e3))
def test_a_weight_in_the_file_is_the_only_one_that_changes(
    tmp_path_factory: pytest.TempPathFactory, name: str, value: float
) -> None:
    path = tmp_path_factory.getbasetemp() / "one.toml"
    found = _read(path, f'{name} = {{ value = {value!r}, unit = "{DEFAULT_WEIGHTS[name].unit}" }}')
    assert found.as_dict() == DEFAULT_WEIGHTS.as_dict() | {name: value}


FAULTS = {
    "no TOML": ("accel_bound is 2", "not valid TOML", "mend"),
    "nested without end": ("x = " + "[" * 100_000, "not valid TOML", "mend"),
    "no text": ("accel_bound = \udcff", "no", ""),
    "unknown": ("jerk_bound = 3", "no weight 'jerk_bound'", "accel_bound"),
    "a table of weights": ("[weights]\naccel_bound = 3", "no weight 'weights'", "accel_bound"),
    "bare number": ("accel_bound = 2.0", "no value with a unit", 'unit = "m/s^2"'),
    "no unit": ("accel_bound = { value = 2.0 }", "no value with a unit", 'unit = "m/s^2"'),
    "one more field": ('drift = { value = 1, unit = "m/s", why = "" }', "no value with a unit", '"m/s"'),
    "another unit": ('accel_corner = { value = 5, unit = "rad/s" }', "no number in 'Hz'", '"Hz"'),
    "a unit that is a number": ("accel_corner = { value = 5, unit = 1 }", "no number in 'Hz'", '"Hz"'),
    "a text": ('accel_bound = { value = "2", unit = "m/s^2" }', "no number", "value"),
    "a truth": ('accel_bound = { value = true, unit = "m/s^2" }', "no number", "value"),
    "a list": ('accel_bound = { value = [2], unit = "m/s^2" }', "no number", "value"),
    "zero": ('noise_accel = { value = 0, unit = "m/s^2" }', "outside its bounds", ""),
    "negative": ('drift = { value = -1.0, unit = "m/s" }', "outside its bounds", ""),
    "nan": ('drift = { value = nan, unit = "m/s" }', "is nan", "finite"),
    "infinite": ('drift = { value = inf, unit = "m/s" }', "is inf", "finite"),
    "huge": ("drift = { value = 1" + "0" * 400 + ', unit = "m/s" }', "larger than any number", "value"),
    "twice": (TEXT + TEXT, "not valid TOML", "mend"),
}


@over("fault", FAULTS)
def test_a_faulty_file_is_refused_with_what_is_wrong_and_a_remedy(fault: str, tmp_path: Path) -> None:
    text, what, remedy = FAULTS[fault]
    path = tmp_path / "weights.toml"
    with pytest.raises(InputError) as caught:
        _read(path, text)
    assert caught.value.source == str(path)
    assert what in caught.value.what
    assert remedy in caught.value.remedy
    assert caught.value.remedy


def test_what_is_no_readable_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read: No such file"):
        read_weights(tmp_path / "none.toml")
    with pytest.raises(InputError, match="cannot be read: Is a directory"):
        read_weights(tmp_path)
    (tmp_path / "latin.toml").write_bytes(b'drift = { value = 1, unit = "\xb5m/s" }')
    with pytest.raises(InputError, match="not valid TOML"):
        read_weights(tmp_path / "latin.toml")


def _outcome(path: Path, text: str) -> ParameterTable | InputError:
    try:
        return _read(path, text)
    except InputError as error:
        return error


@pytest.mark.slow
@given(start=st.integers(0, len(TEXT)), length=st.integers(0, 60), patch=st.text(max_size=20))
def test_any_damage_gives_weights_or_an_input_error(
    tmp_path_factory: pytest.TempPathFactory, start: int, length: int, patch: str
) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged.toml"
    outcome = _outcome(path, TEXT[:start] + patch + TEXT[start + length :])
    if isinstance(outcome, InputError):
        assert outcome.remedy
        assert outcome.source == str(path)
    else:
        values = np.array(outcome.values_of(NAMES))
        assert np.all(np.isfinite(values) & (values > 0.0))
