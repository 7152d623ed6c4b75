"""The drive of the link: its loops as quick as they should be, its limits kept, its energy accounted for."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from savgs_ident.plants.profiles import AbstractProfile, Constant, Sine
from savgs_ident.plants.quarter_car.drive import (
    Axes,
    Drive,
    DriveSignals,
    VelocityReference,
    control_current,
    current_rate,
    drive_state,
    holding_drive,
    inertia_at_motor,
    transmission_friction,
)
from savgs_ident.plants.quarter_car.rig import Rig

NOMINAL = np.pi / 2.0
HOLDING = -57.5
"""Load on the link in static equilibrium [N m]: it turns the link towards smaller angles."""

Values = dict[str, Array]


@pytest.fixture(scope="module")
def p(rig: Rig) -> Values:
    return {name: jnp.asarray(value) for name, value in rig.parameters.as_dict().items()}


def run(
    drive: Drive, p: Values, load: Callable[[Array], Array], end: float, samples: int = 4001
) -> tuple[np.ndarray, np.ndarray, DriveSignals]:
    """Times (n,), states (n, 8) and signals of a drive under a load over time [N m]."""
    rate = jax.jit(lambda t, y: drive.rate(p, t, y, load(t)))
    start = np.asarray(drive.start(p, jnp.asarray(0.0), load(jnp.asarray(0.0))))
    times = np.linspace(0.0, end, samples)
    found = solve_ivp(rate, (0.0, end), start, "LSODA", times, rtol=1e-9, atol=1e-9, max_step=5e-3)
    assert found.success
    states = found.y.T
    signals = jax.jit(jax.vmap(lambda t, y: drive.signals(p, t, y, load(t))))
    return times, states, signals(jnp.asarray(times), jnp.asarray(states))


def steady(load: float) -> Callable[[Array], Array]:
    return lambda t: load + jnp.zeros_like(t)


def velocity_drive(velocity: AbstractProfile | float, angle: float = NOMINAL) -> Drive:
    """A drive that is asked for a link velocity [rad/s]."""
    profile = velocity if isinstance(velocity, AbstractProfile) else Constant(velocity)
    return Drive(VelocityReference(profile), angle)


def frictionless(p: Values) -> Values:
    return p | {"motor_static_friction": jnp.asarray(0.0), "motor_gear_efficiency": jnp.asarray(1.0)}


def test_a_small_step_of_current_is_that_of_a_500_hz_loop(p: Values) -> None:
    still, zero = jnp.asarray(0.0), jnp.asarray(0.0)

    @jax.jit
    def rate(t: float, y: Array) -> Array:
        current, integral = Axes(y[0], y[1]), Axes(y[2], y[3])
        voltage, integral_rate = control_current(p, current, Axes(zero, zero + 0.1), integral, still)
        return jnp.stack([*current_rate(p, current, voltage, still), *integral_rate])

    times = np.linspace(0.0, 2e-3, 2001)
    found = solve_ivp(rate, (0.0, 2e-3), np.zeros(4), "LSODA", times, rtol=1e-10, atol=1e-12)
    expected = 0.1 * (1.0 - np.exp(-2.0 * np.pi * 500.0 * times))
    np.testing.assert_allclose(found.y[1], expected, atol=1e-4)
    assert np.max(np.abs(found.y[0])) < 1e-9


@pytest.fixture(scope="module")
def slopes(p: Values) -> np.ndarray:
    """d(rate)/d(state) of the drive at rest under its static load, without friction, (8, 8)."""
    smooth, drive = frictionless(p), velocity_drive(0.0)
    t, load = jnp.asarray(0.0), jnp.asarray(HOLDING)
    rest = drive.start(smooth, t, load)
    return np.asarray(jax.jit(jax.jacfwd(lambda y: drive.rate(smooth, t, y, load)))(rest))


def _response(slopes: np.ndarray, frequency: float) -> complex:
    """Link velocity over the filtered reference at a frequency [Hz]."""
    inner = 2j * np.pi * frequency * np.eye(7) - slopes[:7, :7]
    return complex(np.linalg.solve(inner, slopes[:7, 7])[1])


def test_the_velocity_loop_crosses_over_at_60_hz(slopes: np.ndarray) -> None:
    def loop_gain(frequency: float) -> float:
        closed = _response(slopes, frequency)
        return abs(closed / (1.0 - closed)) - 1.0

    assert brentq(loop_gain, 20.0, 200.0, xtol=0.01) == pytest.approx(60.0, rel=0.03)


def test_the_velocity_loop_leaves_no_error_at_rest(slopes: np.ndarray) -> None:
    assert abs(_response(slopes, 1e-3) - 1.0) < 1e-4


def test_at_rest_the_motor_holds_the_load_and_nothing_moves(p: Values) -> None:
    drive, zero = holding_drive(NOMINAL), jnp.asarray(0.0)
    load = jnp.asarray(HOLDING)
    state = drive.start(p, zero, load)
    assert np.max(np.abs(np.asarray(drive.rate(p, zero, state, load)))) < 1e-9
    torque = float(drive.signals(p, zero, state, load).torque)
    assert torque == pytest.approx(57.5 / 40.0)
    assert torque < p["motor_stall_torque"]


def test_a_held_link_gives_way_by_a_few_milliradians(p: Values) -> None:
    """As the recordings' own servo does, which gives way by up to 2 mrad in a dwell."""
    times, states, _ = run(holding_drive(NOMINAL), p, lambda t: HOLDING + 20.0 * jnp.sin(4 * jnp.pi * t), 2.0)
    away = np.abs(states[:, 0] - NOMINAL)
    assert 5e-4 < np.max(away[times > 1.0]) < 4e-3


def test_a_step_of_load_leaves_no_error_of_position(p: Values) -> None:
    drive = holding_drive(NOMINAL)
    _, states, _ = run(drive, frictionless(p), lambda t: HOLDING + 20.0 * jnp.clip(t / 0.1, 0.0, 1.0), 2.0)
    assert abs(states[-1, 0] - NOMINAL) < 1e-7


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_motor_keeps_its_speed_limit(p: Values, direction: float) -> None:
    _, states, _ = run(velocity_drive(direction * 20.0), p, steady(0.0), 0.5)
    speed = 40.0 * direction * states[:, 1]
    limit = float(p["motor_speed_limit"])
    assert speed[-1] == pytest.approx(limit, rel=1e-4)
    # The integral of the loop carries the speed a little over the limit of its demand.
    assert np.max(speed) < 1.03 * limit


@pytest.mark.parametrize("load", [-120.0, 120.0])
def test_the_motor_keeps_its_power_limit_when_it_drives(p: Values, load: float) -> None:
    _, states, signals = run(velocity_drive(-np.sign(load) * 20.0), p, steady(load), 0.5)
    power = np.asarray(signals.torque) * 40.0 * states[:, 1]
    assert np.max(power) < 500.0 * 1.01
    assert power[-1] == pytest.approx(500.0, rel=2e-3)
    assert abs(40.0 * states[-1, 1]) < 0.9 * float(p["motor_speed_limit"])


def test_the_drive_keeps_its_torque_limit_and_is_overrun_beyond(p: Values) -> None:
    _, states, signals = run(holding_drive(NOMINAL), p, lambda t: -60.0 - 105.0 * jnp.clip(t, 0.0, 1.0), 1.0)
    assert np.max(np.abs(signals.torque)) < 3.4 * 1.002
    assert states[-1, 1] < -0.5


def test_the_integral_does_not_wind_up(p: Values) -> None:
    """After half a second against the power limit the drive stops as soon as it is asked to."""
    asked = Sine(amplitude=20.0, frequency=1.0, mean=0.0, phase=0.0, rise_time=0.0)
    times, states, _ = run(velocity_drive(asked), p, steady(-90.0), 0.5, 5001)
    reversal = times[np.flatnonzero((states[:-1, 1] > 0.0) & (states[1:, 1] <= 0.0))[0]]
    assert reversal == pytest.approx(0.25, abs=0.03)


def test_the_voltage_stays_on_the_bus(p: Values) -> None:
    poor = p | {"motor_dc_bus": jnp.asarray(60.0)}
    _, states, signals = run(velocity_drive(20.0), poor, steady(0.0), 0.5)
    length = np.hypot(signals.voltage.d, signals.voltage.q)
    limit = 60.0 / np.sqrt(3.0)
    assert np.max(length) < limit * (1.0 + 1e-9)
    assert length[-1] == pytest.approx(limit, rel=1e-3)
    # No faster than the voltage that the magnets induce allows.
    assert 40.0 * states[-1, 1] < limit / (4.0 * float(p["motor_flux_linkage"]))
    _, rich, _ = run(velocity_drive(20.0), p, steady(0.0), 0.5)
    assert rich[-1, 1] > 1.5 * states[-1, 1]


@pytest.mark.parametrize(("speed", "carried"), [(100.0, 1.4), (-100.0, -1.4)])
def test_the_gear_passes_on_its_efficiency_when_it_drives(p: Values, speed: float, carried: float) -> None:
    smooth = p | {"motor_static_friction": jnp.asarray(0.0)}
    friction = float(transmission_friction(smooth, jnp.asarray(speed), jnp.asarray(carried)))
    assert carried / (carried + friction) == pytest.approx(0.94)
    driven = float(transmission_friction(smooth, jnp.asarray(-speed), jnp.asarray(carried)))
    assert (carried + driven) / carried == pytest.approx(0.94)


def test_friction_never_drives(p: Values) -> None:
    speed, carried = jnp.meshgrid(jnp.linspace(-5.0, 5.0, 41), jnp.linspace(-3.0, 3.0, 31))
    friction = jax.vmap(jax.vmap(lambda w, c: transmission_friction(p, w, c)))(speed, carried)
    assert np.min(np.asarray(friction * speed)) >= 0.0


def test_the_energy_of_the_drive_is_accounted_for(p: Values) -> None:
    """Electrical energy in is copper loss, friction, work on the strut, and what inertia and field store."""
    asked = Sine(amplitude=5.0, frequency=2.0, mean=1.0, phase=0.3, rise_time=0.2)

    def load(t: Array) -> Array:
        return HOLDING + 15.0 * jnp.sin(20.0 * t)

    times, states, signals = run(velocity_drive(asked), p, load, 1.0, 40_001)
    now = jax.vmap(drive_state)(jnp.asarray(states))
    speed = 40.0 * now.velocity
    electrical = 1.5 * (signals.voltage.d * now.current.d + signals.voltage.q * now.current.q)
    copper = 1.5 * p["motor_resistance"] * (now.current.d**2 + now.current.q**2)
    work = {
        "electrical": electrical,
        "copper": -copper,
        "friction": -signals.friction * speed,
        "strut": signals.load * speed,
    }
    energy = {name: np.trapezoid(np.asarray(power), times) for name, power in work.items()}
    field = (
        0.75 * p["motor_inductance_d"] * now.current.d**2 + 0.75 * p["motor_inductance_q"] * now.current.q**2
    )
    stored = np.asarray(field + 0.5 * inertia_at_motor(p) * speed**2)
    size = np.trapezoid(np.abs(np.asarray(electrical)), times)
    assert abs(sum(energy.values()) - (stored[-1] - stored[0])) < 1e-6 * size
    for name, part in energy.items():
        assert abs(part) > 1e-2 * size, name
