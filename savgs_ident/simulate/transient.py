"""Motions from a given start, by error-controlled time integration.

    road = sweep_road(0.0275, start=0.0, end=3.0, duration=60.0)
    solution = simulate_transient(model, p, road, held_link(np.pi / 2), np.linspace(0.0, 60.0, 30001))
    assert solution.status().ok
    solution.readings.sprung_accel          # (30001,) [m/s^2]

The residual is solved for the accelerations at every stage (:mod:`savgs_ident.simulate.rates`). What is stiff
is a sliding bristle, whose anchor follows within 0.2 ms. It limits the steps of an explicit method to about a
millisecond, which the reversals ask for anyway: Tsitouras' method of order five takes 2-3 times less time
here at equal error than implicit ones (Kvaerno), whose longer steps do not pay for their Jacobians.
"""

from typing import cast

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float
from numpy.typing import ArrayLike

from savgs_ident.core.status import Status
from savgs_ident.model.actuation import AbstractActuation
from savgs_ident.model.dynamics import Coordinates, Motion
from savgs_ident.model.equilibrium import deflection_zero, static_equilibrium
from savgs_ident.model.inputs import Inputs
from savgs_ident.model.quarter_car import Loads, QuarterCar
from savgs_ident.model.road import RoadMotion
from savgs_ident.model.section import TRAVEL, SectionCurves
from savgs_ident.model.sensors import Readings, pass_through
from savgs_ident.model.strut import Link
from savgs_ident.model.tyre import Road
from savgs_ident.model.values import Values
from savgs_ident.simulate.rates import Rates, solve_rates

TOLERANCE = 1e-7
"""Relative tolerance of a step by default."""

STATE_SCALE = (1e-2, 3e-2, 1e-1, 3e-1)
"""Typical z_s [m], theta_LW [rad] and their rates [m/s], [rad/s]: times the tolerance, the absolute one."""

FIRST_STEP = 1e-4
"""Step with which the integration begins [s]."""

LEAST_STEP = 1e-13
"""Shorter steps [s] are no use: an error that does not shrink with the step is no finite number."""

MOST_STEPS = 2_000_000
"""Steps after which the integration gives up: a quarter of an hour of a rig that slides all the time."""


class RigState(eqx.Module):
    """All that the future of a motion depends on.

    Coordinates and velocities; internal states of the effects (s,) [SI]; states of what moves the link (k,).
    """

    q: Coordinates
    qd: Coordinates
    s: Float[Array, " s"]
    actuation: Float[Array, " k"]


class TransientSolution(eqx.Module):
    """A motion at n instants.

    Attributes:
        times: [s], (n,).
        motion: coordinates, velocities and accelerations, each (n,).
        s: internal states of the effects [unit of each], (n, s).
        sd: their rates, (n, s).
        actuation: states of what moves the link [SI], (n, k).
        inputs: what the road and the link did, each (n,).
        readings: what the sensors show, each (n,); the deflection counts from standstill at the nominal link
            angle.
        steps: number of steps that the integration took, rejected ones included [1], ().
        result: how the integration ended.
    """

    times: Float[Array, " n"]
    motion: Motion
    s: Float[Array, "n s"]
    sd: Float[Array, "n s"]
    actuation: Float[Array, "n k"]
    inputs: Inputs
    readings: Readings
    steps: Array
    result: dfx.RESULTS

    def status(self) -> Status:
        """How the integration ended. Only if it is ``ok`` do the arrays hold a motion."""
        if bool(self.result == dfx.RESULTS.successful):
            finite = bool(jnp.isfinite(self.readings.sprung_accel).all())
            return Status.CONVERGED if finite else Status.NOT_FINITE
        if bool(self.result == dfx.RESULTS.max_steps_reached):
            return Status.MAX_ITERATIONS
        return Status.NOT_FINITE

    def state_at(self, index: int) -> RigState:
        """The state at one of the instants, from which a further simulation can go on."""
        q, qd = (Coordinates(*(part[index] for part in each)) for each in self.motion[:2])
        return RigState(q, qd, self.s[index], self.actuation[index])


@eqx.filter_jit
def rest_state(
    model: QuarterCar,
    p: Values,
    road: RoadMotion,
    link: AbstractActuation,
    t: Float[Array, ""],
    curves: SectionCurves | None = None,
) -> RigState:
    """The rig at static equilibrium with the road and the link as they stand at time ``t`` [s].

    ``curves`` of the same parameters serve as in :meth:`QuarterCar.residual`.
    """
    angle = link.start_angle(t)
    rest = static_equilibrium(model, p, angle, road.height(t), curves)
    zero = jnp.zeros_like(angle)
    still = Coordinates(zero, zero)
    inputs = Inputs(Road(road.height(t), zero), Link(angle, zero))
    loads = model.loads(p, Motion(rest.q, still, still), rest.s, jnp.zeros_like(rest.s), inputs, curves)
    return RigState(rest.q, still, rest.s, link.start(p, t, loads.link_torque))


def _inputs_and_rates(
    model: QuarterCar,
    p: Values,
    road: RoadMotion,
    link: AbstractActuation,
    t: Array,
    now: RigState,
    curves: SectionCurves | None = None,
    near: Array | None = None,
) -> tuple[Inputs, Rates]:
    inputs = Inputs(road.at(t), link.link(t, now.actuation), road.cam_at(t))
    return inputs, solve_rates(model, p, now.q, now.qd, now.s, inputs, curves, near)


def state_rates(
    model: QuarterCar,
    p: Values,
    road: RoadMotion,
    link: AbstractActuation,
    t: Float[Array, ""],
    now: RigState,
    curves: SectionCurves | None = None,
    near: Float[Array, " y"] | None = None,
) -> RigState:
    """Time derivative of the state at time ``t`` [s], in SI: the right side of the differential equations.

    ``curves`` of the same parameters serve as in :meth:`QuarterCar.residual`, ``near`` as in
    :func:`savgs_ident.simulate.rates.solve_rates`.
    """
    inputs, rates = _inputs_and_rates(model, p, road, link, t, now, curves, near)
    loads = model.loads(p, Motion(now.q, now.qd, rates.qdd), now.s, rates.sd, inputs, curves)
    return RigState(now.qd, rates.qdd, rates.sd, link.rate(p, t, now.actuation, loads.link_torque))


def _scales(model: QuarterCar, link: AbstractActuation) -> Float[Array, " x"]:
    return jnp.asarray([*STATE_SCALE, *(state.scale for state in model.states), *link.scales])


def pack_state(state: RigState) -> Float[Array, " x"]:
    """The state as one vector in SI: coordinates, velocities, internal states, states of what moves the link."""
    return jnp.concatenate([jnp.stack([*state.q, *state.qd]), state.s, state.actuation])


def unpack_state(model: QuarterCar, x: Float[Array, " x"]) -> RigState:
    """The state that :func:`pack_state` made a vector of, in SI."""
    end = 4 + len(model.states)
    return RigState(Coordinates(x[0], x[1]), Coordinates(x[2], x[3]), x[4:end], x[end:])


@eqx.filter_jit
def _integrate(
    model: QuarterCar,
    p: Values,
    road: RoadMotion,
    link: AbstractActuation,
    times: Array,
    start: RigState,
    tolerance: Float[Array, ""],
    curves: SectionCurves,
) -> dfx.Solution:
    def rates(t: object, x: Array, args: None) -> Array:
        return pack_state(state_rates(model, p, road, link, jnp.asarray(t), unpack_state(model, x), curves))

    def out_of_range(t: Array, x: Array, args: None, **kwargs: object) -> Array:
        return jnp.abs(x[1]) > TRAVEL

    controller = dfx.PIDController(
        rtol=tolerance,
        atol=tolerance * _scales(model, link),
        pcoeff=0.2,
        icoeff=0.4,
        dtmin=LEAST_STEP,
        force_dtmin=False,
    )
    return dfx.diffeqsolve(
        dfx.ODETerm(rates),
        dfx.Tsit5(),
        times[0],
        times[-1],
        FIRST_STEP,
        pack_state(start),
        saveat=dfx.SaveAt(ts=times),
        stepsize_controller=controller,
        event=dfx.Event(out_of_range),
        adjoint=dfx.ForwardMode(),
        max_steps=MOST_STEPS,
        throw=False,
    )


_zero = eqx.filter_jit(deflection_zero)


@eqx.filter_jit
def _observe(
    model: QuarterCar,
    p: Values,
    road: RoadMotion,
    link: AbstractActuation,
    found: dfx.Solution,
    zero: Float[Array, ""],
    curves: SectionCurves,
) -> TransientSolution:
    def one(at: tuple[Array, Array]) -> tuple[RigState, Inputs, Motion, Array, Readings]:
        t, now = at[0], unpack_state(model, at[1])
        inputs, rates = _inputs_and_rates(model, p, road, link, t, now, curves)
        seen = model.read(p, now.q.theta_LW, rates.qdd.z_s)
        shown = seen._replace(
            susp_deflection=seen.susp_deflection - model.effective(p)["deflection_gain"] * zero
        )
        return now, inputs, Motion(now.q, now.qd, rates.qdd), rates.sd, shown

    # One after the other: compiling the Newton iteration for all instants side by side takes far longer.
    now, inputs, motion, sd, seen = jax.lax.map(one, (found.ts, found.ys))
    steps, times = found.stats["num_steps"], cast(Array, found.ts)
    readings = seen
    if model.sensors_have_dynamics:
        readings = pass_through(lambda frequency: model.transfers(p, frequency), times, seen)
    return TransientSolution(times, motion, now.s, sd, now.actuation, inputs, readings, steps, found.result)


def simulate_transient(
    model: QuarterCar,
    p: Values,
    road: RoadMotion,
    link: AbstractActuation,
    times: ArrayLike,
    initial: RigState | None = None,
    tolerance: float = TOLERANCE,
) -> TransientSolution:
    """The motion at ``times`` [s], (n,), increasing, that begins at the first of them.

    It begins in the state ``initial``, by default at static equilibrium. ``link`` is a motion imposed on the
    link (:func:`savgs_ident.model.actuation.held_link`) or a drive (:class:`savgs_ident.model.drive.Drive`),
    whose states are then part of the motion. ``tolerance`` is relative, per step. Look at ``status()`` of the
    result before using it. Differentiable in forward mode (``jax.jvp``, ``jax.jacfwd``).
    """
    instants, curves = jnp.asarray(times, dtype=jnp.float64), model.curves(p)
    start = rest_state(model, p, road, link, instants[0], curves) if initial is None else initial
    found = _integrate(model, p, road, link, instants, start, jnp.asarray(tolerance), curves)
    return _observe(model, p, road, link, found, _zero(model, p, curves), curves)


@eqx.filter_jit
def transient_loads(model: QuarterCar, p: Values, solution: TransientSolution) -> Loads:
    """Forces and reactions along a motion, each (n,) or (n, 2)."""
    return jax.vmap(lambda *at: model.loads(p, *at))(
        solution.motion, solution.s, solution.sd, solution.inputs
    )
