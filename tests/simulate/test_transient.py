"""Transients: against the periodic solver, against the books of energy, against finite differences."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

from savgs_ident.core.status import Status
from savgs_ident.plants.base import state_sizes
from savgs_ident.plants.profiles import Sine
from savgs_ident.plants.quarter_car.catalogue import MODELS, build_model, model_parameters
from savgs_ident.plants.quarter_car.drive import holding_drive
from savgs_ident.plants.quarter_car.dynamics import section_curves, upright_mass
from savgs_ident.plants.quarter_car.forces import Inputs
from savgs_ident.plants.quarter_car.inputs import (
    ImposedLink,
    RigSource,
    cam_excitation,
    cam_road,
    flat_road,
    held_link,
)
from savgs_ident.plants.quarter_car.kinematics import Values, linkage, strut_length, suspension_travel
from savgs_ident.plants.quarter_car.plant import QuarterCar, static_equilibrium
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.simulate import transient
from savgs_ident.simulate.periodic import simulate_periodic
from savgs_ident.simulate.readings import harmonics
from savgs_ident.simulate.transient import (
    TransientSolution,
    rest_state,
    simulate_transient,
)

from .programme import loads_along

LIFT = 0.0275
NOMINAL = np.pi / 2.0


@dataclass(frozen=True)
class Bench:
    """A model and its numbers."""

    model: QuarterCar
    p: Values


@pytest.fixture(scope="module")
def simtr(rig: Rig) -> Bench:
    """The rig with friction."""
    names = MODELS["simtr"]
    numbers = model_parameters(rig, names).as_dict()
    return Bench(build_model(rig, names), {name: jnp.asarray(value) for name, value in numbers.items()})


def steady_period(bench: Bench, frequency: float, tolerance: float = 1e-8) -> TransientSolution:
    """One period of a dwell, after as many as it takes until two ends agree to 1e-5 of a typical motion."""
    road, link, period, count = (
        cam_road(LIFT, frequency, rise_time=1.0),
        held_link(NOMINAL),
        1.0 / frequency,
        2048,
    )
    begin, state = 0.0, None
    for turn in range(120):
        end = begin + period if turn else period * np.ceil(1.0 / period)
        times = np.linspace(begin, end, count + 1)
        solution = simulate_transient(bench.model, bench.p, RigSource(road, link), times, state, tolerance)
        assert solution.status() is Status.CONVERGED
        now = solution.state_at(-1)
        if state is not None:
            moved = [abs(float(a - b)) for a, b in zip((*now.q, *now.qd), (*state.q, *state.qd), strict=True)]
            if max(np.array(moved) / np.array(state_sizes(bench.model)[:4])) < 1e-5:
                return solution
        begin, state = end, now
    pytest.fail(f"the dwell at {frequency} Hz does not become periodic")


def orders_1_to_9(solution: TransientSolution) -> np.ndarray:
    """Complex harmonics of acceleration and deflection, (2, 9)."""
    signals = np.stack([solution.readings.sprung_accel, solution.readings.susp_deflection])[:, :-1]
    return 2.0 * np.fft.rfft(signals, axis=1)[:, 1:10] / signals.shape[1]


def largest_difference(bench: Bench, frequencies: tuple[float, ...]) -> np.ndarray:
    """Between transient and periodic harmonics, relative to the first, (D, 2)."""
    periodic = simulate_periodic(bench.model, bench.p, cam_excitation(frequencies, LIFT, NOMINAL))
    assert all(status.ok for status in periodic.status())
    expected = np.asarray(harmonics(bench.model, bench.p, periodic, 9))[:, :, 1:]
    found = np.stack([orders_1_to_9(steady_period(bench, frequency)) for frequency in frequencies])
    return np.max(np.abs(found - expected), axis=2) / np.abs(found[:, :, 0])


@pytest.mark.slow
def test_transients_end_in_the_periodic_motion(simtr: Bench) -> None:
    """A dwell that sticks for long, one below the resonance, one at it, and a fast one."""
    assert np.max(largest_difference(simtr, (0.5, 1.4, 2.35, 6.0))) < 1e-3


def _energy(p: Values, motion: transient.Motion, road: Array, angle: Array) -> Array:
    """Kinetic and potential energy [J] at an instant, from the places of the bodies alone."""
    (z_s, theta), (zd_s, omega) = motion.q, motion.qd
    pose, rate = jax.jvp(lambda at: linkage(p, at), (theta,), (omega,))
    energy = p["m_s"] * (zd_s**2 / 2.0 + p["g"] * z_s)
    for body, mass in {"L": p["m_L"], "U": p["m_U"], "K": upright_mass(p)}.items():
        velocity = getattr(rate, f"cg_{body}") + jnp.stack([jnp.zeros_like(zd_s), zd_s])
        spin, height = getattr(rate, f"roll_{body}"), getattr(pose, f"cg_{body}")[1] + z_s
        energy += mass * (velocity @ velocity / 2.0 + p["g"] * height) + p[f"J_{body}"] * spin**2 / 2.0
    squeeze = p["l_free"] - strut_length(p, theta, angle)
    pressed = jnp.maximum(p["r_free"] - (z_s + pose.W[1] - road) / jnp.cos(pose.roll_K + p["tilt"]), 0.0)
    return energy + p["k_sd"] * squeeze**2 / 2.0 + p["k_t"] * pressed**2 / 2.0


def lever(p: Values, theta_LW: Array, angle: Array) -> Array:
    """Slope of the strut's length in the link angle [m/rad]."""
    return jax.grad(strut_length, argnums=2)(p, theta_LW, angle)


def _power(bench: Bench, solution: TransientSolution) -> dict[str, np.ndarray]:
    """What every source brings in [W], (n,); the losses are negative."""
    p, (q, qd, _), (road, link, *_) = bench.p, solution.motion, solution.inputs
    loads = loads_along(bench.model, p, solution)
    spring = p["k_sd"] * (p["l_free"] - jax.vmap(lambda a, b: strut_length(p, a, b))(q.theta_LW, link.angle))
    torque = jax.vmap(lambda *at: at[0] * lever(p, *at[1:]))(loads.strut, q.theta_LW, link.angle)
    pressed = p["k_t"] * jnp.maximum(loads.touch.compression, 0.0)
    power = {
        "road": loads.vertical * road.velocity,
        "link": -torque * link.velocity,
        "damper": (loads.strut - spring) * loads.strut_rate,
        "tyre damping": (pressed - loads.vertical * loads.touch.cos_tilt) * loads.touch.compression_rate,
        "tyre friction": loads.lateral * loads.touch.lateral_velocity,
        "rail": loads.rail * qd.z_s,
    }
    return {name: np.asarray(value) for name, value in power.items()}


@pytest.mark.slow
def test_the_energy_of_the_rig_is_accounted_for(simtr: Bench) -> None:
    """Road and link work, the losses and what is stored balance over a second with stick and slip."""
    road, link = cam_road(LIFT, 2.35, rise_time=0.5), ImposedLink(Sine(0.2, 1.5, NOMINAL, 0.0, 0.5))
    times = np.linspace(0.0, 1.0, 40_001)
    solution = simulate_transient(simtr.model, simtr.p, RigSource(road, link), times, tolerance=1e-10)
    assert solution.status().ok
    energy = jax.jit(jax.vmap(lambda *at: _energy(simtr.p, *at)))
    road_height, angle = solution.inputs.road.height, solution.inputs.link.angle
    stored = np.asarray(energy(solution.motion, road_height, angle))
    power = _power(simtr, solution)
    work = {name: np.trapezoid(value, times) for name, value in power.items()}
    size = np.trapezoid(np.abs(power["road"]), times)
    assert abs(sum(work.values()) - (stored[-1] - stored[0])) < 1e-6 * size
    for name in ("damper", "tyre damping", "tyre friction", "rail"):
        assert work[name] < -1e-4 * size, name
    assert abs(work["link"]) > 1e-2 * size


@pytest.mark.slow
def test_the_rig_stays_at_rest_on_a_flat_road(simtr: Bench) -> None:
    times = np.linspace(0.0, 0.5, 2049)
    solution = simulate_transient(simtr.model, simtr.p, RigSource(flat_road(), held_link(NOMINAL)), times)
    # A tolerated error of 1e-9 m in the anchor of the bristle is 3e-5 m/s^2 at 1e7 N/m.
    assert np.max(np.abs(solution.readings.sprung_accel)) < 3e-5
    assert np.max(np.abs(solution.readings.susp_deflection)) < 1e-9


@pytest.mark.slow
def test_a_motion_can_be_cut_and_continued(simtr: Bench) -> None:
    road, link = cam_road(LIFT, 2.0, rise_time=0.5), held_link(NOMINAL)
    times = np.linspace(0.0, 1.0, 2049)
    whole = simulate_transient(simtr.model, simtr.p, RigSource(road, link), times, tolerance=1e-9)
    half = simulate_transient(simtr.model, simtr.p, RigSource(road, link), times / 2.0, tolerance=1e-9)
    rest = simulate_transient(
        simtr.model, simtr.p, RigSource(road, link), 0.5 + times / 2.0, half.state_at(-1), tolerance=1e-9
    )
    for one, other in ((whole.motion.q, rest.motion.q), (whole.motion.qd, rest.motion.qd)):
        np.testing.assert_allclose(one.z_s[-1], other.z_s[-1], atol=1e-7)
        np.testing.assert_allclose(one.theta_LW[-1], other.theta_LW[-1], atol=3e-7)


@pytest.mark.slow
def test_the_error_follows_the_tolerance(simtr: Bench) -> None:
    road, link, times = cam_road(LIFT, 2.35, rise_time=0.5), held_link(NOMINAL), np.linspace(0.0, 1.0, 2049)

    def motion(tolerance: float) -> np.ndarray:
        solution = simulate_transient(simtr.model, simtr.p, RigSource(road, link), times, tolerance=tolerance)
        return np.asarray(solution.motion.q.z_s)

    def error(tolerance: float) -> np.floating:
        """Of several runs: where a step ends at a reversal, another rounding halves or doubles it."""
        close = tolerance * np.linspace(0.8, 1.2, 9)
        return np.median([np.max(np.abs(motion(each) - exact)) for each in close])

    exact = motion(1e-11)
    rough, fine = error(1e-5), error(1e-9)
    assert fine < 5e-9
    assert fine < rough / 500.0


@pytest.mark.slow
def test_derivatives_are_those_of_finite_differences(simtr: Bench) -> None:
    road, link, times = cam_road(LIFT, 2.35, rise_time=0.3), held_link(NOMINAL), np.linspace(0.0, 0.6, 2049)

    def acceleration(shift: Array) -> Array:
        p = dict(simtr.p) | {name: simtr.p[name] * (1.0 + shift) for name in ("c_sd", "mu_r", "D_z")}
        solution = simulate_transient(simtr.model, p, RigSource(road, link), times, tolerance=1e-10)
        return solution.readings.sprung_accel

    step = 1e-4
    _, slope = jax.jvp(acceleration, (jnp.zeros(()),), (jnp.ones(()),))
    difference = (acceleration(jnp.asarray(step)) - acceleration(jnp.asarray(-step))) / (2.0 * step)
    # Where the rail comes to stick, the step of the difference moves the instant of a kink.
    error = np.abs(np.asarray(slope - difference)) / np.max(np.abs(slope))
    assert np.median(error) < 1e-5
    assert np.mean(error < 1e-3) > 0.99


@pytest.mark.slow
def test_a_rig_out_of_range_is_named(simtr: Bench) -> None:
    times, link = np.linspace(0.0, 0.5, 2049), held_link(NOMINAL)
    ill = dict(simtr.p) | {"k_t": jnp.asarray(jnp.nan)}
    state = rest_state(simtr.model, simtr.p, RigSource(flat_road(), link), jnp.asarray(0.0))
    solution = simulate_transient(simtr.model, ill, RigSource(flat_road(), link), times, state)
    assert solution.status() is Status.NOT_FINITE
    wild = simulate_transient(simtr.model, simtr.p, RigSource(cam_road(1.0, 4.0, rise_time=0.2), link), times)
    assert wild.status() is Status.NOT_FINITE


@pytest.mark.slow
def test_a_limit_of_steps_is_named(simtr: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transient, "MOST_STEPS", 20)
    times = np.linspace(0.0, 0.5, 11)
    solution = simulate_transient(
        simtr.model, simtr.p, RigSource(cam_road(LIFT, 3.0), held_link(NOMINAL)), times
    )
    assert solution.status() is Status.MAX_ITERATIONS


@pytest.mark.slow
def test_the_solved_rates_leave_no_residual(simtr: Bench) -> None:
    road, link = cam_road(LIFT, 3.0, rise_time=0.1), held_link(NOMINAL)
    times = np.linspace(0.0, 0.5, 2049)
    solution = simulate_transient(simtr.model, simtr.p, RigSource(road, link), times)

    @jax.jit
    @jax.vmap
    def residual(motion: transient.Motion, s: Array, sd: Array, inputs: Inputs) -> Array:
        return simtr.model.residual(simtr.p, motion, s, sd, inputs)

    left = residual(solution.motion, solution.s, solution.sd, solution.inputs)
    assert np.max(np.abs(left)) < 1e-6


@pytest.mark.slow
def test_static_equilibrium_holds_and_carries_the_weight(simtr: Bench) -> None:
    p, model = simtr.p, simtr.model
    equilibrium = jax.jit(lambda angle: static_equilibrium(model, p, angle, jnp.zeros(()), section_curves(p)))
    rest = equilibrium(jnp.asarray(NOMINAL))
    # The drawing is that of the nominal state.
    assert abs(float(rest.q.z_s)) < 1e-8
    assert abs(float(rest.q.theta_LW)) < 1e-8
    assert float(rest.strut) == pytest.approx(5310.0, abs=0.5)
    torque = float(rest.strut * lever(p, rest.q.theta_LW, jnp.asarray(NOMINAL)))
    assert torque == pytest.approx(-57.5, rel=0.02)
    for angle in (0.3, 2.8):
        away = equilibrium(jnp.asarray(angle))
        pose = linkage(p, away.q.theta_LW)
        tilt = pose.roll_K + p["tilt"]
        compression = p["r_free"] - (away.q.z_s + pose.W[1]) / jnp.cos(tilt)
        weight = (p["m_s"] + p["m_u"]) * p["g"]
        assert float(p["k_t"] * compression / jnp.cos(tilt)) == pytest.approx(float(weight), rel=1e-9)


@pytest.mark.slow
def test_equilibrium_is_differentiable(simtr: Bench) -> None:
    def travel(shift: Array) -> Array:
        p = dict(simtr.p) | {"k_sd": simtr.p["k_sd"] * (1.0 + shift), "E_y": simtr.p["E_y"] * (1.0 + shift)}
        angle, flat = jnp.asarray(1.2) + shift, jnp.zeros(())
        rest = static_equilibrium(simtr.model, p, angle, flat, section_curves(p))
        return suspension_travel(p, rest.q.theta_LW)

    step, one = 1e-4, jnp.ones(())
    value_and_slope = jax.jit(lambda shift: jax.jvp(travel, (shift,), (one,)))
    above, below = (float(value_and_slope(shift * one)[0]) for shift in (step, -step))
    assert float(value_and_slope(0.0 * one)[1]) == pytest.approx((above - below) / (2.0 * step), rel=1e-6)


@pytest.mark.slow
def test_deflection_counts_from_standstill_at_the_nominal_angle(simtr: Bench) -> None:
    stiff = dict(simtr.p) | {"k_sd": simtr.p["k_sd"] * 1.05}
    times, still = np.linspace(0.0, 0.5, 2049), cam_road(0.0, 1.0, rise_time=1.0)
    solution = simulate_transient(simtr.model, stiff, RigSource(still, held_link(NOMINAL)), times)
    assert abs(float(solution.motion.q.theta_LW[0])) > 1e-3
    assert np.max(np.abs(solution.readings.susp_deflection)) < 1e-8


@pytest.mark.slow
def test_a_drive_holds_the_link_through_a_dwell(simtr: Bench) -> None:
    """The link gives way a little; the energy that it takes from the rig is what the drive's shaft gets."""
    drive, road = holding_drive(NOMINAL), cam_road(LIFT, 2.35, rise_time=0.5)
    times = np.linspace(0.0, 1.5, 32_769)
    solution = simulate_transient(simtr.model, simtr.p, RigSource(road, drive), times, tolerance=1e-9)
    assert solution.status().ok
    away = np.abs(np.asarray(solution.inputs.link.angle) - NOMINAL)
    assert away[0] == 0.0
    assert 2e-4 < np.max(away) < 5e-3
    rigid = simulate_transient(
        simtr.model, simtr.p, RigSource(road, held_link(NOMINAL)), times[::16], tolerance=1e-9
    )
    accel, stiff = solution.readings.sprung_accel[::16], rigid.readings.sprung_accel
    assert 1e-4 < np.std(accel - stiff) / np.std(stiff) < 0.05
    still = simulate_transient(
        simtr.model, simtr.p, RigSource(cam_road(0.0, 2.35, rise_time=0.5), drive), times
    )
    assert np.max(np.abs(np.asarray(still.inputs.link.angle) - NOMINAL)) < 1e-7
    power = _power(simtr, solution)
    energy = jax.jit(jax.vmap(lambda *at: _energy(simtr.p, *at)))
    stored = np.asarray(energy(solution.motion, solution.inputs.road.height, solution.inputs.link.angle))
    work = sum(np.trapezoid(value, times) for value in power.values())
    assert abs(work - (stored[-1] - stored[0])) < 2e-6 * np.trapezoid(np.abs(power["road"]), times)
