"""What a test lasts and where it is evaluated; what a run is worth, on signals whose worth is known."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from savgs_ident.control.closed_loop.programme import (
    FADE,
    REST,
    LoopTest,
    Ride,
    RideGain,
    bump_test,
    compare_rides,
    drive_use,
    harmonic_test,
    iso_test,
    measure_ride,
    ride_after,
    sweep_test,
)
from savgs_ident.control.closed_loop.run import FRAME, ClosedLoopRun, Signals
from savgs_ident.control.synthesis import RATE
from savgs_ident.core.status import Status
from savgs_ident.core.values import Values

from ..in_one_test import over
from .loops import along

CAM = 0.0275
FREQUENCIES = st.floats(0.3, 6.0)
DRIVE: Values = {"motor_gear_ratio": jnp.asarray(40.0), "motor_speed_limit": jnp.asarray(100.0 * np.pi)}
"""3000 turns per minute, 40:1."""

TESTS = (
    harmonic_test(CAM, 2.0),
    harmonic_test(CAM, 2.35),
    sweep_test(CAM),
    iso_test("C", 20.0),
    bump_test(5.5),
)
AT_TWO = TESTS[0]

Array = NDArray[np.float64]


def times_of(test: LoopTest) -> Array:
    """The instants of a run of a test [s]."""
    return np.arange(round(test.duration * RATE)) / RATE


def a_run(test: LoopTest, status: Status = Status.CONVERGED, **signals: Array) -> ClosedLoopRun:
    """A run of a test with some signals, the others 0."""
    time = times_of(test)
    empty = {name: np.zeros(time.size) for name in Signals._fields}
    return ClosedLoopRun(Signals(**{**empty, "time": time, **signals}), status)


def while_driven(test: LoopTest, wave: Callable[[Array], Array]) -> Array:
    """A motion that ends with the road."""
    time = times_of(test)
    return np.where(time < test.end + FADE, wave(time), 0.0)


@over("test", TESTS, ids=lambda test: test.title)
def test_every_test_lasts_whole_frames_and_ends_with_a_road_that_stands_still(test: LoopTest) -> None:
    frames = test.duration * RATE / FRAME
    assert frames == pytest.approx(round(frames), abs=1e-6)
    at_rest, _ = along(test.road, np.linspace(test.end + FADE, test.duration, 300))
    assert test.duration - test.end - FADE == pytest.approx(REST)
    assert np.ptp(at_rest) == 0.0
    moving, _ = along(test.road, np.linspace(test.start, test.end, 300))
    assert np.ptp(moving) > 0.01


@over("test", TESTS, ids=lambda test: test.title)
def test_something_fails_while_the_test_is_evaluated_and_the_road_moves(test: LoopTest) -> None:
    assert test.start < test.fails_at < test.end
    later, _ = along(test.road, np.linspace(test.fails_at, test.end, 300))
    assert np.ptp(later) > 0.01


@given(frequency=FREQUENCIES)
def test_a_harmonic_test_is_evaluated_over_whole_periods_up_to_half_a_frame(frequency: float) -> None:
    test = harmonic_test(CAM, frequency)
    periods = (test.end - test.start) * frequency
    assert round(periods) >= 1
    assert abs(periods - round(periods)) <= 0.5 * FRAME / RATE * frequency * (1.0 + 1e-9)


@given(
    frequency=FREQUENCIES,
    phase=st.floats(0.0, 6.3),
    amplitude=st.floats(0.01, 5.0),
    mean=st.floats(-3.0, 3.0),
)
def test_the_rms_of_a_sine_is_its_amplitude_over_root_two_wherever_it_begins_and_lies(
    frequency: float, phase: float, amplitude: float, mean: float
) -> None:
    test = harmonic_test(CAM, frequency)
    wave = while_driven(test, lambda t: mean + amplitude * np.sin(2.0 * np.pi * frequency * t + phase))
    run = a_run(test, sprung_accel=wave, susp_deflection=0.1 * wave, tyre_load=1000.0 * wave)
    ride = measure_ride(run, test)
    rms = amplitude / np.sqrt(2.0)
    # Half a frame more or less than whole periods.
    left = 0.5 * FRAME / RATE / (test.end - test.start) + 1e-3
    assert ride.sprung_accel == pytest.approx(rms, rel=left)
    assert ride.susp_deflection == pytest.approx(0.1 * rms, rel=left)
    assert ride.tyre_load == pytest.approx(1000.0 * rms, rel=left)


def test_what_happens_outside_the_evaluated_time_does_not_count() -> None:
    time = times_of(AT_TWO)
    outside = (time < AT_TWO.start) | (time >= AT_TWO.end)
    quiet, wild = np.sin(4.0 * np.pi * time), np.where(outside, 100.0, np.sin(4.0 * np.pi * time))
    assert measure_ride(a_run(AT_TWO, sprung_accel=wild), AT_TWO) == measure_ride(
        a_run(AT_TWO, sprung_accel=quiet), AT_TWO
    )


def test_after_a_failure_only_what_follows_counts() -> None:
    time = times_of(AT_TWO)
    wave = np.where(time < AT_TWO.fails_at, 5.0, 1.0) * np.sin(4.0 * np.pi * time)
    run = a_run(AT_TWO, sprung_accel=wave)
    assert ride_after(run, AT_TWO).sprung_accel == pytest.approx(np.sqrt(0.5), rel=1e-6)
    assert measure_ride(run, AT_TWO).sprung_accel == pytest.approx(np.sqrt(0.5 * 13.0), rel=1e-6)


def test_the_time_without_contact_is_that_at_which_the_plate_carries_nothing() -> None:
    time = times_of(AT_TWO)
    load = np.where((time >= 5.0) & (time < 6.0), 0.0, 3600.0)
    assert measure_ride(a_run(AT_TWO, tyre_load=load), AT_TWO).lifts == pytest.approx(1.0 / 8.0)


@pytest.mark.parametrize(("growth", "stable"), [(-3.0, True), (-0.1, False), (0.2, False)])
def test_a_motion_that_goes_on_when_the_road_stands_is_not_stable(growth: float, stable: bool) -> None:
    time = times_of(AT_TWO)
    left = np.where(time < AT_TWO.end, 1.0, np.exp(growth * (time - AT_TWO.end)))
    run = a_run(AT_TWO, susp_deflection=0.01 * left * np.sin(7.0 * time))
    assert measure_ride(run, AT_TWO).stable is stable


def test_a_run_that_is_not_finite_is_not_stable_and_worth_nothing() -> None:
    ride = measure_ride(a_run(AT_TWO, Status.NOT_FINITE, sprung_accel=np.full(14_500, np.nan)), AT_TWO)
    assert not ride.stable
    assert np.isnan([ride.sprung_accel, ride.susp_deflection, ride.tyre_load, ride.lifts]).all()


@given(share=st.floats(0.0, 3.0))
def test_the_gain_is_what_the_rms_fell_by(share: float) -> None:
    passive = Ride(2.0, 0.01, 700.0, 0.0, stable=True)
    active = Ride(2.0 * share, 0.01 * share**2, 700.0, 0.0, stable=True)
    gain = compare_rides(passive, active)
    assert gain.sprung_accel == pytest.approx(100.0 * (1.0 - share), abs=1e-9)
    assert gain.susp_deflection == pytest.approx(100.0 * (1.0 - share**2), abs=1e-9)
    assert gain.tyre_load == 0.0


def test_a_rig_that_did_not_move_gains_nothing() -> None:
    still = Ride(0.0, 0.0, 0.0, 0.0, stable=True)
    assert compare_rides(still, still) == RideGain(0.0, 0.0, 0.0)


def test_what_a_lost_run_gains_is_not_known() -> None:
    lost = Ride(np.nan, np.nan, np.nan, np.nan, stable=False)
    moving = Ride(1.0, 0.01, 300.0, 0.0, stable=True)
    for passive, active in ((lost, moving), (moving, lost)):
        gain = compare_rides(passive, active)
        assert np.isnan([gain.sprung_accel, gain.susp_deflection, gain.tyre_load]).all()
    use = drive_use(a_run(AT_TWO, Status.NOT_FINITE), AT_TWO, DRIVE)
    assert np.isnan([use.speed_peak_rpm, use.saturated, use.energy, *use.angle_deg]).all()
    assert use.saturated_from is None


@pytest.mark.parametrize("speed", [0.2, 1.0, 5.5, 30.0])
def test_the_test_of_a_bump_ends_behind_it(speed: float) -> None:
    test = bump_test(speed)
    _, velocity = along(test.road, np.linspace(test.end - 1.5, test.duration, 50))
    height, _ = along(test.road, np.linspace(0.0, test.end, 20_001))
    assert np.max(height) == pytest.approx(0.05, rel=1e-3)
    assert np.all(velocity == 0.0)


def test_speed_angle_and_power_are_the_extremes_of_the_evaluated_time() -> None:
    time = times_of(AT_TWO)
    inside = (time >= AT_TWO.start) & (time < AT_TWO.end)
    wave = np.sin(4.0 * np.pi * time)
    run = a_run(
        AT_TWO,
        link_velocity=np.where(inside, 5.0 * wave - 1.0, 50.0),
        link_angle=np.where(inside, np.radians(90.0 + 30.0 * wave), 0.0),
        shaft_power=np.where(inside, 200.0 * wave - 40.0, 900.0),
    )
    found = drive_use(run, AT_TWO, DRIVE)
    assert found.speed_peak_rpm == pytest.approx(6.0 * 40.0 * 60.0 / (2.0 * np.pi), rel=1e-4)
    assert found.angle_deg == pytest.approx((60.0, 120.0), abs=0.01)
    assert found.power_peak == pytest.approx(160.0, rel=1e-4)


@given(share=st.floats(0.05, 0.95))
def test_saturation_is_the_share_of_time_in_which_more_is_asked_than_the_motor_gives(share: float) -> None:
    """A sine of the amplitude A is beyond the limit for 1 - 2/pi asin(limit/A) of the time, both ways."""
    limit = 100.0 * np.pi / 40.0
    amplitude = limit / np.sin(0.5 * np.pi * (1.0 - share))
    time = times_of(AT_TWO)
    asked = amplitude * np.sin(4.0 * np.pi * time)
    found = drive_use(a_run(AT_TWO, asked=asked), AT_TWO, DRIVE)
    first = AT_TWO.start + 0.25 * (1.0 - share) * 0.5
    # Counted from 99.9 % of the limit on: that is another 3 % of the time where the sine only just passes it.
    assert found.saturated == pytest.approx(share, abs=0.035)
    assert found.saturated >= share - 0.005
    assert found.saturated_from == pytest.approx(first, abs=0.006)


def test_a_drive_that_is_asked_for_less_than_it_gives_is_never_saturated() -> None:
    asked = np.full(times_of(AT_TWO).size, 0.99 * 100.0 * np.pi / 40.0)
    found = drive_use(a_run(AT_TWO, asked=asked), AT_TWO, DRIVE)
    assert (found.saturated, found.saturated_from) == (0.0, None)


def test_energy_is_what_was_taken_less_what_was_given_back() -> None:
    """P = 50 + 100 cos over 8 s; below zero for a third of each period: (sqrt 3 - pi / 3) 50 / pi on average."""
    power = 50.0 + 100.0 * np.cos(4.0 * np.pi * times_of(AT_TWO))
    found = drive_use(a_run(AT_TWO, electric_power=power), AT_TWO, DRIVE)
    assert found.energy == pytest.approx(400.0, rel=1e-9)
    assert found.returned == pytest.approx(8.0 * 50.0 / np.pi * (np.sqrt(3.0) - np.pi / 3.0), rel=1e-4)
