"""The rig with describing functions: near the nonlinear one at the size of the test, stable, one and the same."""

import control
import numpy as np
import pytest

from savgs_ident.control import linear_study
from savgs_ident.control.describing_function import OUTPUTS, Described, quasi_linear_space
from savgs_ident.control.linear_study import TEST_FREQUENCY, SmallMotions
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values

PLACES = (0, 6, 13)


def _space(model: QuarterCar, p: Values, described: Described, place: int) -> control.StateSpace:
    return quasi_linear_space(model, p, described.damping[place], described.stiffness[place])


def test_it_has_the_first_harmonics_of_the_nonlinear_rig_on_the_cam(
    at_test: linear_study.CamMotions,
) -> None:
    """Friction, damper and the amplitude of the test; what is left are the tyre and the linkage."""
    assert at_test.error < 0.006


def test_the_small_motion_s_model_is_far_off_at_the_size_of_the_test(
    at_test: linear_study.CamMotions, small: SmallMotions
) -> None:
    place = int(np.argmin(np.abs(TEST_FREQUENCY - 2.0)))
    sticks = np.interp(2.0, small.frequency, np.abs(small.models["exact linearisation"][:, 0]))
    assert abs(sticks / np.abs(at_test.nonlinear[place, 0]) - 1.0) > 0.2


def test_friction_takes_energy_at_every_frequency(at_test: linear_study.CamMotions) -> None:
    assert np.all(at_test.described.damping > 0.0)


@pytest.mark.parametrize("place", PLACES)
def test_its_state_space_is_its_response_at_its_own_frequency(
    friction: QuarterCar, numbers: Values, at_test: linear_study.CamMotions, place: int
) -> None:
    iw = 2j * np.pi * at_test.described.frequency[place]
    space = _space(friction, numbers, at_test.described, place)
    assert tuple(space.output_labels) == OUTPUTS
    assert space(iw)[:, 0] * iw == pytest.approx(at_test.quasi_linear[place], rel=1e-9)


def test_its_state_space_is_stable_but_for_the_height_of_the_road(
    friction: QuarterCar, numbers: Values, at_test: linear_study.CamMotions
) -> None:
    for place in range(TEST_FREQUENCY.size):
        poles = np.sort_complex(_space(friction, numbers, at_test.described, place).poles())
        assert np.all(poles[:-1].real < 0.0)
        assert poles[-1] == 0.0


def test_friction_moves_the_resonance_up_as_the_paper_reports(at_test: linear_study.CamMotions) -> None:
    """From about 2 Hz without friction to 2.35 Hz with it."""
    low = TEST_FREQUENCY < 4.0
    peak = TEST_FREQUENCY[np.argmax(np.abs(at_test.nonlinear[low, 0]))]
    modelled = TEST_FREQUENCY[np.argmax(np.abs(at_test.quasi_linear[low, 0]))]
    assert peak == modelled
    assert peak == pytest.approx(2.35, abs=0.16)
