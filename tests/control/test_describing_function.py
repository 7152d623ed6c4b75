"""Describing functions, and the rig with them against the nonlinear one."""

from dataclasses import replace

import numpy as np
import pytest

from savgs_ident.control import linear_study
from savgs_ident.control.linear_study import TEST_FREQUENCY, SmallMotions
from savgs_ident.control.linearisation import (
    ELEMENTS,
    DescribingFunctions,
    describe,
    linearise,
    quasi_linear_response,
    resting,
)
from savgs_ident.core.values import Values, as_values
from savgs_ident.plants.quarter_car.catalogue import build_model, model_parameters
from savgs_ident.plants.quarter_car.inputs import cam_excitation
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.simulate.periodic import PeriodicSettings, PeriodicSolution, simulate_periodic
from savgs_ident.simulate.readings import harmonics

CAM = 0.0275
FREQUENCY = np.array([0.7, 2.0, 4.5])
NOMINAL = np.pi / 2.0
RAIL, STRUT, LATERAL = range(len(ELEMENTS))


@pytest.fixture(scope="module")
def straight(rig: Rig) -> Rig:
    """The rig with a viscous damper: a table on a straight line."""
    return replace(rig, damper_force=tuple(3000.0 * each for each in rig.damper_velocity))


def _motion(
    rig: Rig, names: tuple[str, ...], nodes: int = PeriodicSettings.nodes, **changed: float
) -> tuple[Values, PeriodicSolution, DescribingFunctions]:
    model = build_model(rig, names)
    p = as_values(model_parameters(rig, names).as_dict() | changed)
    settings = PeriodicSettings(nodes=nodes)
    solution = simulate_periodic(model, p, cam_excitation(FREQUENCY, CAM, NOMINAL), settings)
    assert all(status.ok for status in solution.status())
    return p, solution, describe(model, p, solution)


@pytest.mark.slow
def test_viscous_elements_are_their_own_damping_and_no_stiffness(straight: Rig) -> None:
    p, _, described = _motion(straight, ("rail_viscous",), rail_viscous_damping=800.0)
    model = build_model(straight, ("rail_viscous",))
    own = float(p["c_sd"]) * (float(model.damper(np.float64(0.1))) / 0.1)
    assert described.damping[:, RAIL] == pytest.approx(800.0, rel=1e-9)
    assert described.damping[:, STRUT] == pytest.approx(own, rel=1e-9)
    assert described.stiffness[:, (RAIL, STRUT)] == pytest.approx(0.0, abs=1e-5)
    assert np.all(described.gain[:, LATERAL] == 0.0)


@pytest.mark.slow
def test_coulomb_friction_of_a_sliding_motion_is_its_describing_function(rig: Rig) -> None:
    """Exactly for a sine; 2 N bend the motion of 320 kg little, and presliding takes less than a micrometre."""
    force = 2.0
    names = ("rail_preload",)
    model = build_model(rig, names)
    p, solution, described = _motion(rig, names, nodes=512, rail_preload_force=force)
    accel = np.abs(np.asarray(harmonics(model, p, solution, 1))[:, 0, 1]) / float(p["accel_gain"])
    omega = 2.0 * np.pi * FREQUENCY
    reach = accel / omega**2
    assert np.all(reach > 1000.0 * force / float(p["k_pre"]))
    wanted = 4.0 * force / (np.pi * omega * reach)
    assert np.max(np.abs(described.gain[:, RAIL] / -wanted - 1.0)) < 0.01


def test_the_gain_of_damping_and_stiffness_is_that_of_a_spring_beside_a_damper() -> None:
    """F = -(c + k/(i omega)) v: in phase with the velocity the damper, with the way the spring."""
    c, k = np.array([[2000.0, 5.0, 0.0]]), np.array([[-300.0, 1e5, 7.0]])
    iw = 2j * np.pi * 3.0
    described = DescribingFunctions(np.array([3.0]), -(c + k / iw))
    assert described.damping == pytest.approx(c)
    assert described.stiffness == pytest.approx(k, rel=1e-12)


@pytest.mark.slow
def test_a_rig_with_its_own_damping_for_gains_is_the_exact_linearisation(straight: Rig) -> None:
    model = build_model(straight, ())
    p = as_values(model_parameters(straight, ()).as_dict())
    frequency = np.geomspace(0.3, 20.0, 30)
    own = float(p["c_sd"]) * float(model.damper(np.float64(0.1))) / 0.1
    gain = np.tile(np.array([0.0, -own, 0.0], np.complex128), (frequency.size, 1))
    found = quasi_linear_response(model, p, DescribingFunctions(frequency, gain))
    iw = 2j * np.pi * frequency
    exact = linearise(model, p, resting(model, p, NOMINAL))(iw)[:2, 0] * iw
    seen = np.array([float(p["accel_gain"]), float(p["deflection_gain"])])
    assert found == pytest.approx(exact.T * seen, rel=1e-7)


@pytest.mark.slow
def test_it_has_the_first_harmonics_of_the_nonlinear_rig_on_the_cam(
    at_test: linear_study.CamMotions,
) -> None:
    """Friction, damper and the amplitude of the test; what is left are the tyre and the linkage."""
    assert at_test.error < 0.006


@pytest.mark.slow
def test_the_small_motion_s_model_is_far_off_at_the_size_of_the_test(
    at_test: linear_study.CamMotions, small: SmallMotions
) -> None:
    place = int(np.argmin(np.abs(TEST_FREQUENCY - 2.0)))
    sticks = np.interp(2.0, small.frequency, np.abs(small.models["exact linearisation"][:, 0]))
    assert abs(sticks / np.abs(at_test.nonlinear[place, 0]) - 1.0) > 0.2


@pytest.mark.slow
def test_friction_takes_energy_at_every_frequency(at_test: linear_study.CamMotions) -> None:
    assert np.all(at_test.described.damping > 0.0)


@pytest.mark.slow
def test_friction_moves_the_resonance_up_as_the_paper_reports(at_test: linear_study.CamMotions) -> None:
    """From about 2 Hz without friction to 2.35 Hz with it."""
    low = TEST_FREQUENCY < 4.0
    peak = TEST_FREQUENCY[np.argmax(np.abs(at_test.nonlinear[low, 0]))]
    modelled = TEST_FREQUENCY[np.argmax(np.abs(at_test.quasi_linear[low, 0]))]
    assert peak == modelled
    assert peak == pytest.approx(2.35, abs=0.16)
