"""The public calls of simulation, with plants that are no rig, and what the rig's own are made of."""

from typing import Any

import numpy as np
import pytest

import savgs_ident as si
from savgs_ident.plants.axis import Axis
from savgs_ident.plants.quarter_car.inputs import cam_excitation, nominal_test
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.two_mass import PARAMETERS, closed_form
from savgs_ident.recordings.recording import Campaign
from savgs_ident.simulate.excitation import sine_excitation, typical_amplitude

TWO_MASS = si.PlantModel(si.TwoMass(), PARAMETERS)
AXIS = si.PlantModel(Axis(), Axis.parameters.with_values({"holding": 1e4}))
HERTZ = (0.7, 1.5, 2.35, 9.0)


def test_a_linear_plant_answers_as_its_closed_form_says() -> None:
    found = si.simulate(TWO_MASS, HERTZ, orders=3)
    assert found.trusted
    np.testing.assert_array_equal(found.driven, 0.01)
    curve, wanted = found.curve("two masses"), closed_form(PARAMETERS.as_dict(), np.array(HERTZ))
    np.testing.assert_allclose(curve.transfer, wanted, rtol=1e-3)
    np.testing.assert_allclose(curve.peak_to_peak, 0.02 * np.abs(wanted), rtol=1e-3)


def test_an_axis_is_driven_by_its_force() -> None:
    found = si.simulate(AXIS, HERTZ, orders=3, amplitude=150.0)
    p, w = AXIS.table.as_dict(), 2j * np.pi * np.array(HERTZ)
    np.testing.assert_array_equal(found.driven, 150.0)
    wanted = 1.0 / (p["mass"] * w**2 + p["viscous_friction"] * w + p["holding"])
    np.testing.assert_allclose(found.curve("axis").transfer[:, 0], wanted, rtol=1e-3)


def test_a_carriage_without_a_spring_is_refused_with_the_reason() -> None:
    loose = si.PlantModel(Axis(), Axis.parameters)
    with pytest.raises(si.InputError, match="no force brings x back") as caught:
        si.simulate(loose, (1.0, 2.0), orders=3, amplitude=100.0)
    assert "controller" in str(caught.value)


@pytest.mark.slow
def test_a_slow_sweep_of_a_linear_plant_passes_through_its_closed_form() -> None:
    """At 2 Hz, 40 s after the start, but for the lag of a sweep, -i/2 dw/dt H''; the input is what was asked for."""
    sweep = si.simulate_sweep(TWO_MASS, amplitude=0.005)
    assert sweep.trusted
    np.testing.assert_allclose(sweep.driven, 0.005 * np.sin(np.pi * 0.05 * sweep.time**2), atol=1e-12)
    window = np.abs(sweep.time - 40.0) < 1.0
    kernel = np.hanning(np.count_nonzero(window)) * np.exp(-1j * np.pi * 0.05 * sweep.time[window] ** 2)
    found = sweep.readings[:, window] @ kernel / (sweep.driven[window] @ kernel)
    assert sweep.frequency[window].mean() == pytest.approx(2.0, rel=1e-3)
    step = 1e-3
    before, there, after = closed_form(PARAMETERS.as_dict(), 2.0 + step * np.array([-1.0, 0.0, 1.0]))
    bend = (after - 2.0 * there + before) / (2.0 * np.pi * step) ** 2
    np.testing.assert_allclose(found, there - 0.5j * (2.0 * np.pi * 0.05) * bend, rtol=0.03)


def test_a_plant_moves_as_far_as_it_declares() -> None:
    """The rig by the stroke of its cam, others by the typical size of a coordinate."""
    rig = si.load_rig()
    assert typical_amplitude(QuarterCar, rig.parameters) == rig.parameters["cam_peak_to_peak"].value / 2.0
    assert typical_amplitude(si.TwoMass(), PARAMETERS) == 0.01
    assert typical_amplitude(Axis(), Axis.parameters) == pytest.approx(100.0)


def test_the_rig_is_driven_by_its_cam_with_the_link_held() -> None:
    table = si.load_rig().parameters
    lift, angle = nominal_test(table.as_dict())
    found = sine_excitation(QuarterCar, table, np.array(HERTZ), {"road_height": lift / 2.0})
    wanted = cam_excitation(HERTZ, lift, angle)
    np.testing.assert_array_equal(found.frequency, wanted.frequency)
    assert found.harmonics.keys() == wanted.harmonics.keys()
    for name, harmonics in wanted.harmonics.items():
        np.testing.assert_array_equal(found.harmonics[name], harmonics)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"frequency": (2.0, 0.0)}, "0 Hz is no frequency"),
        ({"frequency": (np.nan,)}, "nan Hz is no frequency"),
        ({"frequency": (2.0,), "amplitude": 0.0}, "an amplitude of 0 moves nothing"),
        ({"orders": 0}, "orders is 0"),
        (
            {"frequency": (2.0,), "campaign": True},
            "a campaign has frequencies, amplitudes and levels of its own",
        ),
        (
            {"amplitude": 0.01, "campaign": True},
            "a campaign has frequencies, amplitudes and levels of its own",
        ),
    ],
)
def test_what_contradicts_itself_is_refused(given: dict[str, Any], said: str) -> None:
    if given.get("campaign"):
        given = given | {"campaign": Campaign("empty.csv", (), (), "")}
    with pytest.raises(si.InputError, match=said):
        si.simulate(TWO_MASS, **given)
    with pytest.raises(si.InputError, match="moves nothing"):
        si.simulate_sweep(TWO_MASS, amplitude=-1.0)
