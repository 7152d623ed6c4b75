"""The whole loop on the nonlinear rig: against other solvers, the motor's books, its limits, the paper's figures."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float

from savgs_ident.control.closed_loop.laws import make_failure
from savgs_ident.control.closed_loop.programme import compare_rides, drive_use, measure_ride
from savgs_ident.control.closed_loop.run import ClosedLoopRun, Loop
from savgs_ident.core.values import Values
from savgs_ident.plants.profiles import AbstractProfile, Scalar
from savgs_ident.plants.quarter_car.drive import Drive, VelocityReference, inertia_at_motor
from savgs_ident.plants.quarter_car.inputs import RigSource, cam_excitation
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.simulate.periodic import simulate_periodic
from savgs_ident.simulate.readings import harmonics
from savgs_ident.simulate.transient import simulate_transient

from .loops import CAM, NO_FRICTION, along, cam, evaluated, harmonics_of, ideal, passive, ran, with_changed

pytestmark = pytest.mark.slow

AT_TWO = cam(2.0)
SAMPLES = 2501
"""Of the beginning of a run, until the road has been at its full height for half a second."""

ORDERS = 9


class Held(AbstractProfile):
    """A value held from each millisecond to the next."""

    levels: Float[Array, " n"]

    def value(self, t: Scalar) -> Scalar:
        """The level since the last whole millisecond."""
        return self.levels[jnp.floor(1000.0 * t + 1e-6).astype(jnp.int32)]


@pytest.fixture(scope="module")
def held(friction: QuarterCar, numbers: Values, loop: Loop) -> ClosedLoopRun:
    """The passive rig at 2 Hz."""
    return ran(friction, numbers, AT_TWO, passive(loop, numbers))


@pytest.fixture(scope="module")
def active(friction: QuarterCar, numbers: Values, loop: Loop) -> ClosedLoopRun:
    """The active rig at 2 Hz, with noise."""
    return ran(friction, numbers, AT_TWO, loop)


@pytest.fixture(scope="module")
def quiet(friction: QuarterCar, numbers: Values, loop: Loop) -> ClosedLoopRun:
    """The active rig at 2 Hz with ideal instruments."""
    return ran(friction, numbers, AT_TWO, ideal(loop))


@pytest.fixture(scope="module")
def smooth(numbers: Values) -> Values:
    """The rig and its drive without friction."""
    return with_changed(numbers, **NO_FRICTION)


@pytest.fixture(scope="module")
def sliding(friction: QuarterCar, smooth: Values, loop: Loop) -> ClosedLoopRun:
    """The active rig at 2 Hz without friction."""
    return ran(friction, smooth, AT_TWO, loop)


@pytest.mark.parametrize(("rigid", "within"), [(False, 1e-3), (True, 0.01)])
def test_the_passive_run_ends_in_the_periodic_motion(
    friction: QuarterCar, numbers: Values, held: ClosedLoopRun, rigid: bool, within: float
) -> None:
    """With the motion by which the drive gives way imposed on its link, closely; with a rigid link, within 1 %."""
    signals = evaluated(held.signals, AT_TWO)
    link = harmonics_of(signals.link_angle, signals.time, 2.0, ORDERS)
    assert 5e-4 < abs(link[1]) < 4e-3
    if rigid:
        link = np.where(np.arange(ORDERS + 1) == 0, np.pi / 2.0, 0.0j)
    cam = cam_excitation(2.0, CAM, 0.0)
    excitation = cam._replace(harmonics={**cam.harmonics, "link_angle": jnp.asarray(link)[None]})
    solution = simulate_periodic(friction, numbers, excitation)
    assert all(status.ok for status in solution.status())
    wanted = np.asarray(harmonics(friction, numbers, solution, 1))[0, :, 1]
    found = np.array(
        [
            harmonics_of(each, signals.time, 2.0, 1)[1]
            for each in (signals.sprung_accel, signals.susp_deflection)
        ]
    )
    assert np.max(np.abs(found / wanted - 1.0)) < within


@pytest.mark.parametrize("with_friction", [True, False])
def test_the_active_run_is_that_of_an_error_controlled_integration(
    friction: QuarterCar,
    numbers: Values,
    smooth: Values,
    active: ClosedLoopRun,
    sliding: ClosedLoopRun,
    with_friction: bool,
) -> None:
    """Of the same rig, drive and road, by Tsitouras' method, while the drive is asked for what the law asked for."""
    p, signals = (numbers, active.signals) if with_friction else (smooth, sliding.signals)
    drive = Drive(VelocityReference(Held(jnp.asarray(signals.asked))), p["psi_nominal"])
    times = np.asarray(signals.time)[:SAMPLES]
    exact = simulate_transient(friction, p, RigSource(AT_TWO.road, drive), times, tolerance=1e-6)
    assert exact.status().ok
    allowed = {"susp_deflection": 3e-4, "link_angle": 3e-4, "link_velocity": 5e-4, "sprung_accel": 3e-3}
    if not with_friction:
        # Without sticking and sliding, which begin within a step and shake the sprung mass.
        allowed = dict.fromkeys(allowed, 3e-4)
    truths = (
        exact.readings.susp_deflection,
        exact.inputs.link.angle,
        exact.inputs.link.velocity,
        exact.readings.sprung_accel,
    )
    for (name, within), truth in zip(allowed.items(), map(np.asarray, truths), strict=True):
        left = np.std(getattr(signals, name)[:SAMPLES] - truth) / np.std(truth)
        assert left < within, name


def test_the_plate_carries_the_weight_at_rest_and_on_average(sliding: ClosedLoopRun, smooth: Values) -> None:
    """Over whole periods, where no friction holds the rig: nothing else holds it up."""
    weight = float((smooth["m_s"] + smooth["m_u"]) * smooth["g"])
    load = evaluated(sliding.signals, AT_TWO).tyre_load
    assert sliding.signals.tyre_load[0] == pytest.approx(weight, rel=1e-6)
    assert np.mean(load) == pytest.approx(weight, abs=2e-3 * np.std(load))
    assert np.std(load) > 0.05 * weight


def test_the_road_of_a_run_is_that_of_the_test(active: ClosedLoopRun) -> None:
    height, _ = along(AT_TWO.road, np.arange(active.signals.time.size) / 1000.0)
    assert active.signals.road == pytest.approx(height, abs=1e-15)
    assert np.ptp(height) == pytest.approx(CAM, rel=1e-6)


def test_what_the_motor_takes_is_copper_loss_and_work_on_its_shaft(
    quiet: ClosedLoopRun, numbers: Values
) -> None:
    """Over whole periods, from torque and speed alone; against all that flows to and fro."""
    signals, p = evaluated(quiet.signals, AT_TWO), numbers
    current = signals.motor_torque / (1.5 * p["motor_pole_pairs"] * p["motor_flux_linkage"])
    copper = float(np.mean(1.5 * p["motor_resistance"] * current**2))
    shaft = float(np.mean(signals.motor_torque * p["motor_gear_ratio"] * signals.link_velocity))
    electric = float(np.mean(signals.electric_power))
    flow = float(np.mean(np.abs(signals.electric_power)))
    assert abs(electric - copper - shaft) < 3e-3 * flow
    for part in (copper, shaft, electric):
        assert abs(part) > 0.02 * flow
    use = drive_use(quiet, AT_TWO, p)
    lasts = AT_TWO.end - AT_TWO.start
    assert use.energy == pytest.approx(electric * lasts)
    assert use.energy + 2.0 * use.returned == pytest.approx(flow * lasts)


@pytest.mark.parametrize("limit", [100.0 * np.pi, 200.0])
def test_the_motor_passes_its_speed_limit_by_no_more_than_its_loop_lets_it(
    friction: QuarterCar, numbers: Values, loop: Loop, limit: float
) -> None:
    """At 3 Hz, where more is asked for. The limit is on the demand; the torque of the run-up has to be taken back.

    The proportional gain of the velocity loop turns that torque into an excess of speed: 5 % of 3000 rpm.
    """
    test, p = cam(3.0), with_changed(numbers, motor_speed_limit=limit)
    run = ran(friction, p, test, loop)
    speed = 40.0 * np.asarray(run.signals.link_velocity)
    assert np.max(40.0 * np.abs(run.signals.asked)) > 1.1 * limit
    run_up = np.max(np.abs(np.gradient(speed, 1e-3)[np.abs(speed) > 0.9 * limit]))
    excess = np.max(np.abs(speed)) - limit
    assert 0.0 < excess < float(inertia_at_motor(p)) * run_up / float(p["motor_velocity_kp"])
    use = drive_use(run, test, p)
    assert use.saturated > 0.1
    assert use.speed_peak_rpm == pytest.approx(np.max(np.abs(speed[4000:8000])) * 30.0 / np.pi, rel=1e-9)


def test_a_weak_drive_is_used_up_to_its_torque_and_power_and_no_further(
    friction: QuarterCar, numbers: Values, loop: Loop
) -> None:
    """Half of 3.4 N m and of 500 W at 3 Hz; the limits are on the demand, and the current follows within 3 %."""
    run = ran(friction, numbers, cam(3.0), loop._replace(failure=make_failure("actuator-weak", 0.0)))
    torque, power = np.max(np.abs(run.signals.motor_torque)), np.max(run.signals.shaft_power)
    assert 0.99 * 1.7 < torque < 1.03 * 1.7
    assert 0.99 * 250.0 < power < 1.03 * 250.0


@pytest.fixture(scope="module")
def idle(friction: QuarterCar, numbers: Values, loop: Loop) -> ClosedLoopRun:
    """The rig at 2 Hz with a controller that asks for nothing: one program with the active one."""
    silent = eqx.tree_at(lambda law: (law.c, law.d), loop.law, replace_fn=jnp.zeros_like)
    return ran(friction, numbers, AT_TWO, loop._replace(law=silent))


def test_at_2_hz_the_active_rig_moves_less_than_one_that_asks_for_nothing(
    idle: ClosedLoopRun, active: ClosedLoopRun
) -> None:
    gain = compare_rides(measure_ride(idle, AT_TWO), measure_ride(active, AT_TWO))
    assert gain.sprung_accel > 35.0
    assert gain.susp_deflection > 25.0
    assert gain.tyre_load > 0.0
    assert measure_ride(active, AT_TWO).stable


def test_at_2_hz_the_active_rig_moves_less_by_what_the_paper_found(
    held: ClosedLoopRun, active: ClosedLoopRun
) -> None:
    """Fig. 10: 41.44 % of the acceleration's rms and 31.11 % of the deflection's; the weights are not the paper's."""
    gain = compare_rides(measure_ride(held, AT_TWO), measure_ride(active, AT_TWO))
    assert gain.sprung_accel > 35.0
    assert gain.susp_deflection > 25.0
    assert gain.tyre_load > 0.0
    assert measure_ride(active, AT_TWO).stable


def test_the_same_loop_runs_the_same_way_twice(
    friction: QuarterCar, numbers: Values, loop: Loop, active: ClosedLoopRun
) -> None:
    again = ran(friction, numbers, AT_TWO, loop)
    assert all(np.array_equal(one, other) for one, other in zip(again.signals, active.signals, strict=True))
