"""The whole loop when a part of it fails half-way through a steady motion of 2 Hz."""

import numpy as np
import pytest

from savgs_ident.control.closed_loop.laws import KINDS, NOTHING, make_failure
from savgs_ident.control.closed_loop.programme import RideGain, compare_rides, ride_after
from savgs_ident.control.closed_loop.run import ClosedLoopRun, Loop
from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.plant import QuarterCar

from .loops import cam, passive, ran

pytestmark = pytest.mark.slow

TEST = cam(2.0)
FAILS = round(1000.0 * TEST.fails_at)
"""The sample from which on something has failed."""


@pytest.fixture(scope="module")
def runs(friction: QuarterCar, numbers: Values, loop: Loop) -> dict[str, ClosedLoopRun]:
    """The active rig by kind of failure."""
    return {
        kind: ran(friction, numbers, TEST, loop._replace(failure=make_failure(kind, TEST.fails_at)))
        for kind in KINDS
    }


@pytest.fixture(scope="module")
def gains(
    friction: QuarterCar, numbers: Values, loop: Loop, runs: dict[str, ClosedLoopRun]
) -> dict[str, RideGain]:
    """What is left of the gain after each of them."""
    before = ride_after(ran(friction, numbers, TEST, passive(loop, numbers)), TEST)
    return {kind: compare_rides(before, ride_after(run, TEST)) for kind, run in runs.items()}


def test_until_something_fails_all_runs_are_the_same(runs: dict[str, ClosedLoopRun]) -> None:
    for run in runs.values():
        for one, other in zip(run.signals, runs[NOTHING].signals, strict=True):
            assert np.array_equal(one[:FAILS], other[:FAILS])


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != NOTHING])
def test_every_failure_makes_a_difference(runs: dict[str, ClosedLoopRun], kind: str) -> None:
    after = runs[kind].signals.link_angle[FAILS:] - runs[NOTHING].signals.link_angle[FAILS:]
    # The reading of the link is good to 2e-6 rad.
    assert np.max(np.abs(after)) > 1e-3


@pytest.mark.parametrize("kind", KINDS)
def test_the_loop_stays_stable_whatever_fails(runs: dict[str, ClosedLoopRun], kind: str) -> None:
    assert all(np.isfinite(each).all() for each in runs[kind].signals)
    assert ride_after(runs[kind], TEST).stable
    # And at rest in the end: the link, too.
    assert np.ptp(runs[kind].signals.link_angle[-250:]) < np.radians(0.5)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != NOTHING])
def test_the_rig_rides_no_worse_than_a_passive_one_by_more_than_three_tenths(
    gains: dict[str, RideGain], kind: str
) -> None:
    gain = gains[kind]
    assert min(gain.sprung_accel, gain.susp_deflection, gain.tyre_load) > -30.0


def test_half_a_drive_is_enough_at_2_hz(gains: dict[str, RideGain]) -> None:
    """Its motion is that of the whole one but for the peaks."""
    whole, half = gains[NOTHING], gains["actuator-weak"]
    assert (half.sprung_accel, half.susp_deflection) == pytest.approx(
        (whole.sprung_accel, whole.susp_deflection), abs=3.0
    )


def test_without_a_drive_the_strut_turns_the_link_to_where_it_rests(
    runs: dict[str, ClosedLoopRun], gains: dict[str, RideGain]
) -> None:
    """In line with the strut, at 0 or 180 deg, where that has no lever; from there on the rig is a passive one."""
    angle = np.degrees(runs["actuator-off"].signals.link_angle)
    assert 50.0 < angle[FAILS] < 130.0
    assert np.min(np.abs(angle[-1] - np.array([0.0, 180.0]))) < 1.0
    assert abs(gains["actuator-off"].sprung_accel) < 30.0
    assert abs(gains["actuator-off"].susp_deflection) < 30.0
    assert np.max(np.abs(runs["actuator-off"].signals.motor_torque[FAILS + 20 :])) < 1e-3 * 3.4


def test_an_encoder_that_jumps_stops_the_link(runs: dict[str, ClosedLoopRun]) -> None:
    """The first reading that is not believed is followed by a demand of no velocity, and the drive keeps to that."""
    signals = runs["encoder"].signals
    assert abs(signals.asked[FAILS]) > 0.1
    assert np.all(signals.asked[FAILS + 1 :] == 0.0)
    later = signals.link_angle[FAILS + 200 :]
    assert np.ptp(later) < np.radians(3.0)
    assert np.ptp(signals.link_angle[4000:FAILS]) > np.radians(30.0)
