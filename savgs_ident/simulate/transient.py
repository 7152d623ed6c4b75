"""Motions from a given start, by error-controlled time integration.

    source = RigSource(sweep_road(0.0275, start=0.0, end=3.0, duration=60.0), held_link(np.pi / 2))
    solution = simulate_transient(plant, p, source, np.linspace(0.0, 60.0, 30001))
    assert solution.status().ok
    solution.readings          # one array (30001,) for each channel of the plant

At every stage the residual is solved for what an integration asks: the accelerations and the rates of the internal
states. They are its root in (qdd, sd), which is piecewise smooth only: a friction that depends on its load depends on
the accelerations, too.

What is stiff is a sliding bristle, whose anchor follows within 0.2 ms. It limits the steps of an explicit method to
about a millisecond, which the reversals ask for anyway: Tsitouras' method of order five takes 2-3 times less time
here at equal error than implicit ones (Kvaerno), whose longer steps do not pay for their Jacobians.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, cast

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float
from numpy.typing import ArrayLike

from savgs_ident.core.small_root import Root, find_root
from savgs_ident.core.status import Status
from savgs_ident.core.values import Values
from savgs_ident.plants.at_rest import find_rest, nominal_readings, standing
from savgs_ident.plants.base import AbstractPlant, AbstractSource, Motion, state_sizes

TOLERANCE = 1e-7
"""Relative tolerance of a step by default."""

STATE_TIME = 1e-2
"""Time [s] in which an internal state typically changes by its scale."""

FIRST_STEP = 1e-4
"""Step with which the integration begins [s]."""

LEAST_STEP = 1e-13
"""Shorter steps [s] are no use: an error that does not shrink with the step is no finite number."""

MOST_STEPS = 2_000_000
"""Steps after which the integration gives up: a quarter of an hour of a rig that slides all the time."""

SHORTEST = 1e-12
"""Shortest time between two readings [s]: a record of one instant has none."""


class Rates(NamedTuple):
    """Accelerations (n scalars) and rates of the internal states (s,), in SI, and how they were found."""

    qdd: Any
    sd: Float[Array, " s"]
    root: Root


def solve_rates(
    model: AbstractPlant,
    p: Values,
    q: Any,
    qd: Any,
    s: Float[Array, " s"],
    u: Any,
    prepared: Any = None,
    warm_start: Float[Array, " k"] | None = None,
) -> Rates:
    """Accelerations and rates that make the residual vanish, in SI; look at the status of their root.

    ``prepared`` serves as in :meth:`AbstractPlant.residual`; ``warm_start`` (n + s,) are accelerations and
    rates of a moment ago, from where they are found sooner. Differentiable in everything, exactly, by the implicit
    function theorem.
    """
    n = len(model.coordinates)

    def residual(y: Array) -> Array:
        motion = Motion(q, qd, model.coordinate_type(*jnp.unstack(y[:n])))
        return model.residual(p, motion, s, y[n:], u, prepared)

    rates = [state.scale / STATE_TIME for state in model.states]
    scale = jnp.asarray([*(each.acceleration_size for each in model.coordinates), *rates])
    start = jnp.zeros_like(scale) if warm_start is None else warm_start
    root = find_root(residual, start, scale)
    return Rates(model.coordinate_type(*jnp.unstack(root.x[:n])), root.x[n:], root)


class PlantState(eqx.Module):
    """All that the future of a motion depends on.

    Coordinates and rates; internal states of the effects (s,) [SI]; states of what drives the plant (k,).
    """

    q: Any
    qd: Any
    s: Float[Array, " s"]
    source: Float[Array, " k"]


class TransientSolution(eqx.Module):
    """A motion at n instants.

    Attributes:
        times: [s], (n,).
        motion: coordinates, rates and accelerations, each (n,).
        s: internal states of the effects [unit of each], (n, s).
        sd: their rates, (n, s).
        source: states of what drives the plant [SI], (n, k).
        inputs: the plant's inputs, each (n,).
        readings: what the sensors show, each (n,), counted from standstill in the nominal state.
        steps: number of steps that the integration took, rejected ones included [1], ().
        result: how the integration ended.
    """

    times: Float[Array, " n"]
    motion: Motion
    s: Float[Array, "n s"]
    sd: Float[Array, "n s"]
    source: Float[Array, "n k"]
    inputs: Any
    readings: Any
    steps: Array
    result: dfx.RESULTS

    def status(self) -> Status:
        """How the integration ended. Only if it is ``ok`` do the arrays hold a motion."""
        if bool(self.result == dfx.RESULTS.successful):
            finite = all(bool(jnp.isfinite(each).all()) for each in self.readings)
            return Status.CONVERGED if finite else Status.NOT_FINITE
        if bool(self.result == dfx.RESULTS.max_steps_reached):
            return Status.MAX_ITERATIONS
        return Status.NOT_FINITE

    def state_at(self, index: int) -> PlantState:
        """The state at one of the instants, from which a further simulation can go on."""
        q, qd = (jax.tree.map(lambda part: part[index], each) for each in self.motion[:2])
        return PlantState(q, qd, self.s[index], self.source[index])


@eqx.filter_jit
def rest_state(
    model: AbstractPlant, p: Values, source: AbstractSource, t: Float[Array, ""], prepared: Any = None
) -> PlantState:
    """The plant at static equilibrium with its inputs as they stand at time ``t`` [s]."""
    u = source.at_rest(model, t)
    q, s, _ = find_rest(model, p, u, prepared)
    motion = standing(model, q)
    loads = model.loads(p, motion, s, jnp.zeros_like(s), u, prepared)
    return PlantState(q, motion.qd, s, source.start(p, t, loads))


def _inputs_and_rates(
    model: AbstractPlant,
    p: Values,
    source: AbstractSource,
    t: Array,
    now: PlantState,
    prepared: Any = None,
    warm_start: Array | None = None,
) -> tuple[Any, Rates]:
    u = source.inputs(model, t, now.source)
    return u, solve_rates(model, p, now.q, now.qd, now.s, u, prepared, warm_start)


def state_rates(
    model: AbstractPlant,
    p: Values,
    source: AbstractSource,
    t: Float[Array, ""],
    now: PlantState,
    prepared: Any = None,
    warm_start: Float[Array, " k"] | None = None,
) -> PlantState:
    """Time derivative of the state at time ``t`` [s], in SI: the right side of the differential equations.

    ``prepared`` serves as in :meth:`AbstractPlant.residual`, ``warm_start`` as in :func:`solve_rates`.
    """
    u, rates = _inputs_and_rates(model, p, source, t, now, prepared, warm_start)
    loads = model.loads(p, Motion(now.q, now.qd, rates.qdd), now.s, rates.sd, u, prepared)
    return PlantState(now.qd, rates.qdd, rates.sd, source.rate(p, t, now.source, loads))


def pack_state(state: PlantState) -> Float[Array, " x"]:
    """The state as one vector in SI: coordinates, rates, internal states, states of what drives the plant."""
    return jnp.concatenate([jnp.stack([*state.q, *state.qd]), state.s, state.source])


def unpack_state(model: AbstractPlant, x: Float[Array, " x"]) -> PlantState:
    """The state that :func:`pack_state` made a vector of, in SI."""
    n = len(model.coordinates)
    end = 2 * n + len(model.states)
    q, qd = (model.coordinate_type(*jnp.unstack(x[first : first + n])) for first in (0, n))
    return PlantState(q, qd, x[2 * n : end], x[end:])


@eqx.filter_jit
def _integrate(
    model: AbstractPlant,
    p: Values,
    source: AbstractSource,
    times: Array,
    start: PlantState,
    tolerance: Float[Array, ""],
    prepared: Any,
) -> dfx.Solution:
    travel = jnp.asarray([each.travel for each in model.coordinates])

    def rates(t: object, x: Array, args: None) -> Array:
        return pack_state(state_rates(model, p, source, jnp.asarray(t), unpack_state(model, x), prepared))

    def out_of_range(t: Array, x: Array, args: None, **kwargs: object) -> Array:
        return jnp.any(jnp.abs(x[: travel.size]) > travel)

    controller = dfx.PIDController(
        rtol=tolerance,
        atol=tolerance * jnp.asarray([*state_sizes(model), *source.scales]),
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


_nominal_readings = eqx.filter_jit(nominal_readings)


@eqx.filter_jit
def _observe(
    model: AbstractPlant,
    p: Values,
    source: AbstractSource,
    found: dfx.Solution,
    zeros: tuple[Array, ...],
    prepared: Any,
) -> TransientSolution:
    def one(at: tuple[Array, Array]) -> tuple[PlantState, Any, Motion, Array, Any]:
        t, now = at[0], unpack_state(model, at[1])
        u, rates = _inputs_and_rates(model, p, source, t, now, prepared)
        motion = Motion(now.q, now.qd, rates.qdd)
        seen = model.read(p, motion, now.s, rates.sd, u, prepared)
        return now, u, motion, rates.sd, jax.tree.map(jnp.subtract, seen, zeros)

    # One after the other: compiling the Newton iteration for all instants side by side takes far longer.
    now, u, motion, sd, readings = jax.lax.map(one, (found.ts, found.ys))
    steps, times = found.stats["num_steps"], cast(Array, found.ts)
    if model.sensors_have_dynamics:
        shown = through_sensors(partial(model.transfers, p), times, jnp.stack(readings))
        readings = jax.tree.unflatten(jax.tree.structure(readings), list(shown))
    return TransientSolution(times, motion, now.s, sd, now.source, u, readings, steps, found.result)


def through_sensors(
    transfer: Callable[[Float[Array, " f"]], Complex[Array, "C f"]],
    times: Float[Array, " n"],
    truth: Float[Array, "C n"],
) -> Float[Array, "C n"]:
    """Readings at evenly spaced ``times`` [s] after the dynamics of the sensors, in the units of ``truth``.

    ``transfer`` is reading over truth of every channel at frequencies [Hz]. Before and after the record the truth
    counts as what it was at its ends.
    """
    count = times.shape[0]
    rest = count // 2
    total = count + 2 * rest
    step = (times[-1] - times[0]) / max(count - 1, 1)
    padded = jnp.pad(truth, ((0, 0), (rest, rest)), mode="edge")
    frequency = jnp.arange(total // 2 + 1, dtype=step.dtype) / (jnp.maximum(step, SHORTEST) * total)
    shown = jnp.fft.irfft(jnp.fft.rfft(padded) * transfer(frequency), total)
    return shown[:, rest : rest + count]


def simulate_transient(
    model: AbstractPlant,
    p: Values,
    source: AbstractSource,
    times: ArrayLike,
    initial: PlantState | None = None,
    tolerance: float = TOLERANCE,
) -> TransientSolution:
    """The motion at ``times`` [s], (n,), increasing, that begins at the first of them.

    It begins in the state ``initial``, by default at static equilibrium. ``source`` drives the plant; where it has
    states of its own, they are part of the motion. ``tolerance`` is relative, per step. Look at ``status()`` of the
    result before using it. Differentiable in forward mode (``jax.jvp``, ``jax.jacfwd``).
    """
    instants, prepared = jnp.asarray(times, dtype=jnp.float64), model.prepare(p)
    start = rest_state(model, p, source, instants[0], prepared) if initial is None else initial
    found = _integrate(model, p, source, instants, start, jnp.asarray(tolerance), prepared)
    return _observe(model, p, source, found, _nominal_readings(model, p, prepared), prepared)
