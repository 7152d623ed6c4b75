"""One closed-loop run: rig, drive, instruments and law in one diffrax solve.

The law samples the instruments at its rate; its command is held from the next sample on, because the computer needs
the time in between. Between samples the rig and the drive are integrated by :func:`stabilised_step`, as many as the
fastest decay requires. A step of the solve is a frame of :data:`FRAME` samples (a plain scan over the samples takes
a fifth longer); the signals of every sample are stored.

These are Runge-Kutta-Chebyshev steps: explicit, and stable for the stiffness of a rig with a drive. Between two
samples of the controller the motion is smooth at the scale of a millisecond, except for two fast decays that
accuracy does not require to resolve: the current loop (0.3 ms) and the anchor of a sliding bristle (0.2 ms). A
method of s stages and order two after Sommeijer, Shampine and Verwer (1997) is stable for decays as fast as
2/3 (s^2 - 1) per step, less 2 % for damping; with four stages that are 9 800/s at steps of 1 ms, at half
the cost of a common method in steps of 0.5 ms.
"""

from collections.abc import Callable
from functools import partial
from math import ceil
from typing import Any, ClassVar, NamedTuple

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.polynomial.chebyshev import Chebyshev

from savgs_ident.control.closed_loop.laws import NUMBER, AbstractControlLaw, Instruments, LoopFailure
from savgs_ident.core.errors import InputError
from savgs_ident.core.status import Status
from savgs_ident.core.values import Values
from savgs_ident.effects.base import (
    DRAG_TIME,
    SETTLING,
    AbstractInputLaw,
    AbstractSensorLaw,
    AbstractSeriesLaw,
)
from savgs_ident.plants.base import Motion
from savgs_ident.plants.profiles import Constant
from savgs_ident.plants.quarter_car.drive import Drive, VelocityReference, drive_state
from savgs_ident.plants.quarter_car.dynamics import TRAVEL, Coordinates, SectionCurves
from savgs_ident.plants.quarter_car.forces import Inputs
from savgs_ident.plants.quarter_car.inputs import RigSource, RoadMotion
from savgs_ident.plants.quarter_car.kinematics import suspension_travel
from savgs_ident.plants.quarter_car.plant import QuarterCar, deflection_zero
from savgs_ident.simulate.transient import pack_state, rest_state, state_rates, unpack_state

STAGES = 4
"""Stages of a step."""

STABLE = 0.98 * 2.0 / 3.0 * (STAGES**2 - 1)
"""Fastest decay in a step, rate times step [1], for which a step is stable."""

DAMPING = 2.0 / 13.0
"""Damping of the stability polynomial, after the paper: it trades 2 % of the interval for decay within it."""

Vector = Float[Array, " x"]

Field = Callable[[Float[Array, ""], Vector, Vector], Vector]
"""Rates from time [s], state and the rates at a previous instant."""


class _Stage(NamedTuple):
    """Coefficients of the stages from the second on, each (s - 1,)."""

    mu: Array
    nu: Array
    mu_rate: Array
    gamma_rate: Array
    c_before: Array


def _coefficients(stages: int) -> tuple[float, np.ndarray]:
    """Step of the first stage as a share of the whole, and rows of ``_Stage``."""
    w0 = 1.0 + DAMPING / stages**2
    t, t1, t2 = (
        np.array(
            [Chebyshev.basis(j).deriv(m)(w0) if m else Chebyshev.basis(j)(w0) for j in range(stages + 1)]
        )
        for m in (0, 1, 2)
    )
    w1 = t1[stages] / t2[stages]
    b = np.empty(stages + 1)
    b[2:] = t2[2:] / t1[2:] ** 2
    b[:2] = b[2]
    c = np.empty(stages + 1)
    c[2:] = w1 * t2[2:] / t1[2:]
    c[0], c[1] = 0.0, c[2] / t1[2]
    later = np.arange(2, stages + 1)
    mu_rate = 2.0 * b[later] * w1 / b[later - 1]
    a_before = 1.0 - b[later - 1] * t[later - 1]
    mu, nu = 2.0 * b[later] * w0 / b[later - 1], -b[later] / b[later - 2]
    return float(b[1] * w1), np.stack([mu, nu, mu_rate, -a_before * mu_rate, c[later - 1]])


_FIRST, _LATER = _coefficients(STAGES)


def stabilised_step(
    field: Field, t: Float[Array, ""], state: Vector, rates: Vector, step: Float[Array, ""]
) -> tuple[Vector, Vector]:
    """State after a ``step`` [s] from ``t`` [s], where the rates are ``rates``; and the rates of the last stage."""
    coefficients = _Stage(*jnp.asarray(_LATER))

    def stage(
        carried: tuple[Vector, Vector, Vector], k: _Stage
    ) -> tuple[tuple[Vector, Vector, Vector], None]:
        before, last, near = carried
        found = field(t + k.c_before * step, last, near)
        now = (
            (1.0 - k.mu - k.nu) * state
            + k.mu * last
            + k.nu * before
            + step * (k.mu_rate * found + k.gamma_rate * rates)
        )
        return (last, now, found), None

    first = state + _FIRST * step * rates
    (_, end, near), _ = jax.lax.scan(stage, (state, first, rates), coefficients)
    return end, near


FRAME = 20
"""Samples of the law in one step of the solve."""
LONGEST = 1e-3
"""Longest step [s]: components that are not stiff are integrated within 0.01 %."""
SEED = 1
"""Seed of the instruments' noise."""


class Loop(NamedTuple):
    """What closes the loop around a rig: law, instruments, failure, and the ``rate`` [1/s] of the law."""

    law: AbstractControlLaw
    instruments: Instruments
    failure: LoopFailure
    rate: float


class Signals(NamedTuple):
    """The signals at every sample, each (n,); SI.

    Attributes:
        time: [s]. road: height of the plate [m]. sprung_accel: true acceleration of the sprung mass [m/s^2].
        susp_deflection: true deflection from standstill at the nominal link angle [m]. tyre_load: F_tz [N].
        wishbone_angle: theta_LW [rad]. link_angle: [rad]. link_velocity: [rad/s]. asked: link velocity commanded
        by the law [rad/s]. motor_torque: of the motor [N m]; 3 % off in rms against integration with error
        control, because a step resolves
            the decay of the current (0.3 ms) only roughly. So are quantities derived from it: at 2 Hz the net
            electric energy is 2 % low, at 3 Hz the peak power 3 % high. Positions and velocities are accurate to
            0.01 %.
        shaft_power: mechanical power of the motor [W].
        electric_power: electric power of the motor [W]; negative while it generates.
        doubted: 1 once the law has rejected the link angle, 0 before [1].
    """

    time: Array
    road: Array
    sprung_accel: Array
    susp_deflection: Array
    tyre_load: Array
    wishbone_angle: Array
    link_angle: Array
    link_velocity: Array
    asked: Array
    motor_torque: Array
    shaft_power: Array
    electric_power: Array
    doubted: Array


class ClosedLoopRun(NamedTuple):
    """A run: its signals as arrays, and its status."""

    signals: Signals
    status: Status


class _LoopState(NamedTuple):
    """State of rig and drive, their last rates, the state of the law, and its command [rad/s], which is held.

    ``kept`` are the signals of the frame.
    """

    rig: Float[Array, " x"]
    rates: Float[Array, " x"]
    law: Float[Array, " c"]
    asked: Float[Array, ""]
    kept: Float[Array, "frame signals"]


class LoopCase(NamedTuple):
    """A run to be simulated: rig, road, loop, the zero of the deflection [m], and standard normal noise."""

    model: QuarterCar
    p: Values
    curves: SectionCurves
    road: RoadMotion
    loop: Loop
    zero: Float[Array, ""]
    noise: Float[Array, "frames frame 3"]


def run_loop(model: QuarterCar, p: Values, road: RoadMotion, loop: Loop, duration: float) -> ClosedLoopRun:
    """A run of ``duration`` [s], a whole number of frames, from rest at the nominal link angle.

    It fails where a signal is not finite or the motion leaves the travel of the linkage. Raises
    :class:`InputError` as :func:`loop_case` does.
    """
    case = loop_case(model, p, road, loop, duration)
    frames = case.noise.shape[0]
    rows, result = _solve(case, jnp.arange(frames + 1) * (FRAME / loop.rate))
    signals = Signals(*np.asarray(rows).T)
    finite = all(np.isfinite(each).all() for each in signals)
    within = bool(np.max(np.abs(signals.wishbone_angle)) <= TRAVEL)
    ended = bool(result == dfx.RESULTS.successful) and finite and within
    return ClosedLoopRun(signals, Status.CONVERGED if ended else Status.NOT_FINITE)


def loop_case(model: QuarterCar, p: Values, road: RoadMotion, loop: Loop, duration: float) -> LoopCase:
    """The case of a run of ``duration`` [s], a whole number of frames.

    Raises :class:`InputError` for an effect of the test bench (sensor, cam), which cannot be in a closed loop.
    """
    kinds = AbstractSensorLaw | AbstractInputLaw
    of_bench = [effect.name for effect in model.effects if isinstance(effect.law, kinds)]
    if of_bench:
        raise InputError(
            f"an error of the test bench cannot be part of a closed loop: {', '.join(of_bench)}",
            remedy="choose a model without it by --model, or take it out of the rig file's effects",
        )
    frames = round(duration * loop.rate / FRAME)
    curves = model.prepare(p)
    noise = np.random.default_rng(SEED).standard_normal((frames, FRAME, NUMBER))
    return LoopCase(model, p, curves, road, loop, _zero(model, p, curves), jnp.asarray(noise))


_zero = eqx.filter_jit(deflection_zero)


def loop_rest(case: LoopCase) -> Float[Array, " x"]:
    """State of rig and drive at rest at the nominal link angle, at time 0, in SI."""
    still = jnp.zeros(())
    drive = _drive_of(case, still)
    return pack_state(rest_state(case.model, case.p, RigSource(case.road, drive), still, case.curves))


@eqx.filter_jit
def _solve(case: LoopCase, ends: Float[Array, " frames"]) -> tuple[Array, dfx.RESULTS]:
    still = jnp.zeros(())
    begin = loop_rest(case)
    width = len(Signals._fields)
    start = _LoopState(begin, jnp.zeros_like(begin), case.loop.law.start(), still, jnp.zeros((FRAME, width)))

    def rates(t: object, y: _LoopState, args: None) -> _LoopState:
        rig = loop_field(case, y.asked, jnp.asarray(t), y.rig, y.rates)
        return jax.tree.map(jnp.zeros_like, y)._replace(rig=rig)

    found = dfx.diffeqsolve(
        dfx.ODETerm(rates),
        _Sampled(case, steps_within(case.model, 1.0 / case.loop.rate)),
        ends[0],
        ends[-1],
        None,
        start,
        saveat=dfx.SaveAt(steps=True, fn=lambda t, y, args: y.kept),
        stepsize_controller=dfx.StepTo(ends),
        adjoint=dfx.ForwardMode(),
        max_steps=ends.shape[0],
        throw=False,
    )
    kept = found.ys[: ends.shape[0] - 1]
    return kept.reshape(-1, width), found.result


class _Sampled(dfx.AbstractSolver[None]):
    """Steps of one frame: measure, command, and integrate to the next sample, :data:`FRAME` times."""

    case: LoopCase
    steps: int = eqx.field(static=True)
    term_structure: ClassVar = dfx.ODETerm
    interpolation_cls: ClassVar = dfx.LocalLinearInterpolation

    def order(self, terms: object) -> int:
        """Two, between samples."""
        return 2

    def init(self, terms: object, t0: object, t1: object, y0: object, args: object) -> None:
        """No solver state."""
        return None

    def func(self, terms: Any, t0: Any, y0: Any, args: Any) -> Any:
        """The vector field."""
        return terms.vf(t0, y0, args)

    def step(
        self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any, solver_state: None, made_jump: Any
    ) -> tuple[Any, None, dict[str, Any], None, Any]:
        """One frame."""
        loop, p = self.case.loop, self.case.p
        period = (t1 - t0) / FRAME
        step = period / self.steps
        number = jnp.round(t0 * loop.rate / FRAME).astype(jnp.int32)
        fastest = p["motor_speed_limit"] / p["motor_gear_ratio"] * period

        def one(now: _LoopState, at: tuple[Array, Array]) -> tuple[_LoopState, Array]:
            share, normal = at
            t = t0 + share * period
            field = partial(loop_field, self.case, now.asked)
            rates = field(t, now.rig, now.rates)
            measured, signals = loop_sample(self.case, t, now.rig, rates, now.asked)
            readings = loop.failure.shown(t, loop.instruments.read(measured, normal))
            law, asked = loop.law.command(now.law, readings, fastest)
            moved = stabilised_step(field, t, now.rig, rates, step)
            if self.steps > 1:

                def further(moved: tuple[Array, Array], k: Array) -> tuple[tuple[Array, Array], None]:
                    at = t + k * step
                    return stabilised_step(field, at, moved[0], field(at, *moved), step), None

                moved, _ = jax.lax.scan(further, moved, jnp.arange(1.0, self.steps))
            row = jnp.stack(signals._replace(doubted=loop.law.doubted(law)))
            return _LoopState(*moved, law, asked, now.kept), row

        places = jnp.arange(FRAME, dtype=jnp.float64)
        end, rows = jax.lax.scan(one, y0, (places, self.case.noise[number]))
        end = end._replace(kept=rows)
        return end, None, {"y0": y0, "y1": end}, None, dfx.RESULTS.successful


def steps_within(model: QuarterCar, period: float) -> int:
    """Number of steps [1] in a ``period`` [s] between two samples of the law, short enough to be stable.

    The anchor of a sliding bristle decays faster than the current of the motor, and a series compliance faster still.
    """
    series = any(isinstance(effect.law, AbstractSeriesLaw) for effect in model.effects)
    longest = min(LONGEST, STABLE * (SETTLING if series else DRAG_TIME))
    return max(1, ceil(period / longest - 1e-9))


def loop_field(case: LoopCase, asked: Array, t: Array, x: Array, near: Array) -> Array:
    """Rates (x,) of rig and drive at ``t`` [s] in the state ``x`` while the law's command [rad/s] is held.

    ``near`` are the rates at a previous instant, zeros if they are unknown.
    """
    start = near[len(case.model.coordinates) : 2 * len(case.model.coordinates) + len(case.model.states)]
    now = unpack_state(case.model, x)
    drive = _drive_of(case, asked)
    return pack_state(
        state_rates(case.model, _values_at(case, t), RigSource(case.road, drive), t, now, case.curves, start)
    )


def loop_sample(case: LoopCase, t: Array, x: Array, rates: Array, held: Array) -> tuple[Array, Signals]:
    """The measured quantities (3,), sensor gains included, and the signals of a sample at ``t`` [s]; all in SI.

    The law has not seen the measurements yet: ``doubted`` is 0.
    """
    now, change = unpack_state(case.model, x), unpack_state(case.model, rates)
    drive = _drive_of(case, held)
    inputs = Inputs(case.road.at(t), drive.link(t, now.source), case.road.cam_at(t))
    motion = Motion(now.q, now.qd, Coordinates(*change.qd))
    loads = case.model.loads(case.p, motion, now.s, change.s, inputs, case.curves)
    rig = case.model.effective(case.p)
    deflection = suspension_travel(rig, now.q.theta_LW) - case.zero
    acceleration, motor = change.qd.z_s, drive_state(now.source)
    p = _values_at(case, t)
    inside = drive.signals(p, t, now.source, loads.link_torque)
    speed = p["motor_gear_ratio"] * motor.velocity
    voltage, current = jnp.stack(inside.voltage), jnp.stack(motor.current)
    row = Signals(
        t,
        inputs.road.height,
        acceleration,
        deflection,
        loads.vertical,
        now.q.theta_LW,
        motor.angle,
        motor.velocity,
        held,
        inside.torque,
        inside.torque * speed,
        1.5 * voltage @ current,
        jnp.zeros_like(t),
    )
    measured = [rig["accel_gain"] * acceleration, rig["deflection_gain"] * deflection, motor.angle]
    return jnp.stack(measured), row


def _drive_of(case: LoopCase, asked: Array) -> Drive:
    return Drive(VelocityReference(Constant(asked)), case.p["psi_nominal"])


def _values_at(case: LoopCase, t: Array) -> Values:
    share = case.loop.failure.drive_at(t)
    limits = {name: share * case.p[name] for name in ("motor_peak_torque", "motor_peak_power")}
    return {**case.p, **limits}
