"""Periodic steady states of all dwells at once.

A dwell's motion is periodic but not smooth: the rail sticks at every reversal. The motion is found by
periodic collocation in time (:mod:`savgs_ident.simulate.collocation`): a coarse, evenly spaced solution shows
where the accelerations change, the nodes move there, and the solution is repeated on them. The nodes then
serve any nearby parameter set, which is how fits warm-start.

    solution = simulate_periodic(model, p, cam_excitation([2.0, 2.35], 0.0275, np.pi / 2))
    response = harmonics(model, p, solution, orders=9)   # complex, (2 dwells, 2 channels, 10)

What the truncation to a finite number of nodes costs is stated by :func:`truncation_error`, which solves once
more on twice as many nodes.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Int

from savgs_ident.core.status import Status
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.section import TRAVEL
from savgs_ident.model.values import Values, as_values
from savgs_ident.simulate.collocation import (
    Linearised,
    Trajectory,
    residual_at_nodes,
    solve_linearised,
    step_defects,
)
from savgs_ident.simulate.cyclic import solve_nodes
from savgs_ident.simulate.excitation import Excitation, inputs_at
from savgs_ident.simulate.layout import Layout, layout_for
from savgs_ident.simulate.mesh import Mesh, adapted_mesh, turns, uniform_mesh
from savgs_ident.simulate.newton import TOLERANCE, motion_scale, newton_structure, solve_newton
from savgs_ident.simulate.stored import placed, stored

COARSE = 10
"""Iterations on nodes that are to move: enough to show where, whether or not all dwells have converged."""


@dataclass(frozen=True)
class PeriodicSettings:
    """How finely to solve.

    ``nodes`` per period, more in proportion to the period of dwells below ``slow`` [Hz]; ``adaptations`` of the
    nodes to the solution; at most ``iterations`` of Newton's method on the last nodes.
    """

    nodes: int = 256
    slow: float = 1.4
    adaptations: int = 2
    iterations: int = 60


class PeriodicSolution(eqx.Module):
    """Periodic motions of D dwells on P nodes, with what is needed to differentiate them.

    ``last_step`` is the last Newton step of each dwell relative to the size of its motion, (D,).
    """

    excitation: Excitation
    mesh: Mesh
    trajectory: Trajectory
    linearised: Linearised
    last_step: Float[Array, " D"]
    iterations: Int[Array, ""]

    def status(self) -> tuple[Status, ...]:
        """How each dwell ended; a linkage beyond its travel counts as not finite."""
        step, layout = np.asarray(self.last_step), self.mesh.layout
        swing = np.maximum.reduceat(np.abs(np.asarray(self.trajectory.x[1])), layout.starts)
        finite, small = np.isfinite(step) & (swing <= TRAVEL), step <= TOLERANCE
        return tuple(
            Status.CONVERGED if ok and done else Status.MAX_ITERATIONS if ok else Status.NOT_FINITE
            for ok, done in zip(finite, small, strict=True)
        )


def _steps(excitation: Excitation, mesh: Mesh) -> Array:
    return jnp.asarray(mesh.gap) / (2.0 * jnp.pi * excitation.frequency[mesh.layout.dwell])


def solve_on_mesh(
    model: QuarterCar, p: Values, excitation: Excitation, mesh: Mesh, start: Trajectory, limit: int
) -> PeriodicSolution:
    """Newton's method on given nodes from a given start."""
    bounds = jnp.asarray(limit), jnp.asarray(TOLERANCE)
    p, excitation, mesh, start, bounds = placed((p, excitation, mesh, start, bounds))
    parts = _solved(model, p, excitation, mesh, start, *bounds)
    return PeriodicSolution(excitation, mesh, *jax.tree.unflatten(newton_structure(), parts))


@eqx.filter_jit
def _solved(*args: Any) -> tuple[Array, ...]:
    return stored(_solve, *args)


def _solve(
    model: QuarterCar,
    p: Values,
    excitation: Excitation,
    mesh: Mesh,
    start: Trajectory,
    limit: Array,
    enough: Array,
) -> tuple[Array, ...]:
    inputs = inputs_at(excitation, mesh)
    layout, steps = mesh.layout, _steps(excitation, mesh)
    scale = motion_scale(model, inputs, excitation.frequency, layout)
    return tuple(jax.tree.leaves(solve_newton(model, p, start, inputs, layout, steps, scale, limit, enough)))


def solve_near(
    model: QuarterCar, p: Values, known: PeriodicSolution, start: Trajectory, limit: int, enough: float
) -> tuple[Trajectory, Float[Array, ""]]:
    """Motions on the nodes of a ``known`` solution from a close ``start``, and their last relative step.

    To be a part of a larger program that is compiled. Look at the step: it is above ``enough`` where ``limit``
    iterations were too few.
    """
    bounds = jnp.asarray(limit), jnp.asarray(enough)
    parts = _solve(model, p, known.excitation, known.mesh, start, *bounds)
    found = jax.tree.unflatten(newton_structure(), parts)
    return found.trajectory, jnp.max(found.last_step)


@eqx.filter_jit
def _riding_the_road(model: QuarterCar, excitation: Excitation, mesh: Mesh) -> Trajectory:
    """The rig carried along by the road as one: where a cold start begins."""
    road = inputs_at(excitation, mesh).road
    rest = jnp.zeros_like(road.height)
    states = [road.height if state.slips else rest for state in model.states]
    x = jnp.stack([road.height, rest, road.velocity, rest, *states])
    return Trajectory(x, jnp.zeros((2 + len(states), *rest.shape)))


def _carry_over(trajectory: Trajectory, old: Mesh, new: Mesh) -> Trajectory:
    """A trajectory known on old nodes, at new ones, by linear interpolation."""

    def moved(values: np.ndarray) -> np.ndarray:
        out = np.empty((values.shape[0], new.layout.total))
        for dwell in range(len(new.layout.counts)):
            here, there = old.layout.dwell == dwell, new.layout.dwell == dwell
            for row in range(values.shape[0]):
                phase, wanted = np.asarray(old.phase)[here], np.asarray(new.phase)[there]
                out[row, there] = np.interp(wanted, phase, values[row, here], period=2.0 * np.pi)
        return out

    return Trajectory(*(jnp.asarray(moved(np.asarray(part))) for part in trajectory))


def adapt(
    model: QuarterCar, p: Values, solution: PeriodicSolution, layout: Layout, limit: int
) -> PeriodicSolution:
    """The solution again, on nodes that follow its accelerations."""
    accelerations = np.asarray(solution.trajectory.y[:2])
    if not np.isfinite(accelerations).all():
        return solution
    frequency = np.asarray(solution.excitation.frequency)
    mesh = adapted_mesh(solution.mesh, accelerations, frequency, layout)
    start = _carry_over(solution.trajectory, solution.mesh, mesh)
    return solve_on_mesh(model, as_values(p), solution.excitation, mesh, start, limit)


def simulate_periodic(
    model: QuarterCar,
    p: Values,
    excitation: Excitation,
    settings: PeriodicSettings | None = None,
    layout: Layout | None = None,
) -> PeriodicSolution:
    """Periodic motions from a cold start; look at ``status()`` of the result before using it.

    A ``layout`` of an earlier solution with as many dwells spares a compilation.
    """
    p, settings = as_values(p), settings or PeriodicSettings()
    if layout is None:
        layout = layout_for(np.asarray(excitation.frequency), settings.nodes, settings.slow)
    mesh = uniform_mesh(layout)
    start = _riding_the_road(model, excitation, mesh)
    first, *later = [COARSE] * settings.adaptations + [settings.iterations]
    solution = solve_on_mesh(model, p, excitation, mesh, start, first)
    for limit in later:
        solution = adapt(model, p, solution, layout, limit)
    return solution


def resolve(
    model: QuarterCar,
    p: Values,
    solution: PeriodicSolution,
    limit: int = PeriodicSettings.iterations,
    start: Trajectory | None = None,
) -> PeriodicSolution:
    """The solution at other parameters, on the same nodes, started from ``solution`` or a better ``start``."""
    begin = solution.trajectory if start is None else start
    return solve_on_mesh(model, as_values(p), solution.excitation, solution.mesh, begin, limit)


def _readings(model: QuarterCar, p: Values, trajectory: Trajectory) -> Float[Array, "P C"]:
    at_nodes = jax.vmap(partial(model.read, p))
    return jnp.stack(at_nodes(trajectory.x[1], trajectory.y[0]), axis=-1)


def _analyse(signals: Float[Array, "P C"], mesh: Mesh, orders: int) -> Complex[Array, "D C K"]:
    twice = jnp.full(orders + 1, 2.0).at[0].set(1.0)
    kernel = twice * jnp.conj(turns(mesh.phase, orders))
    terms = signals[:, :, None] * (kernel * jnp.asarray(mesh.weight)[:, None])[:, None, :]
    layout = mesh.layout
    return jax.ops.segment_sum(terms, layout.dwell, len(layout.counts), indices_are_sorted=True)


@eqx.filter_jit
def harmonics(
    model: QuarterCar, p: Values, solution: PeriodicSolution, orders: int
) -> Complex[Array, "D C K"]:
    """Complex harmonics 0..orders of the sensor readings, (D, 2, orders + 1), in the channels' SI units.

    Channels are those of :data:`savgs_ident.model.sensors.RESPONSE_CHANNELS`.
    """
    return harmonics_of(model, p, solution.trajectory, solution, orders)


def harmonics_of(
    model: QuarterCar, p: Values, motions: Trajectory, known: PeriodicSolution, orders: int
) -> Complex[Array, "D C K"]:
    """The same of motions on the nodes of a ``known`` solution, as a part of a larger program that is compiled."""
    seen = _analyse(_readings(model, p, motions), known.mesh, orders)
    return seen * _sensors(model, p, known.excitation.frequency, orders)


def _sensors(
    model: QuarterCar, p: Values, frequency: Float[Array, " D"], orders: int
) -> Complex[Array, "D C K"]:
    """What the sensors make of each order."""
    order = jnp.arange(orders + 1, dtype=frequency.dtype)
    return jnp.moveaxis(model.transfers(p, frequency[:, None] * order), 0, 1)


@eqx.filter_jit
def harmonic_sensitivities(
    model: QuarterCar, p: Values, solution: PeriodicSolution, names: tuple[str, ...], orders: int
) -> Complex[Array, "n D C K"]:
    """Derivatives of :func:`harmonics` in the named parameters, by the implicit function theorem.

    One factorisation, that of the last Newton step, serves all parameters.
    """
    return jax.lax.map(directional(model, p, solution, names, orders), jnp.eye(len(names)))


def directional(
    model: QuarterCar, p: Values, solution: PeriodicSolution, names: tuple[str, ...], orders: int
) -> Callable[[Float[Array, " n"]], Complex[Array, "D C K"]]:
    """Derivatives of :func:`harmonics` along directions (n,) of the named parameters, to be mapped over."""
    at = solution.trajectory
    moved_along = _linear_motion(model, p, solution)

    def seen(q: dict[str, Array], motions: Trajectory) -> Array:
        return harmonics_of(model, q, motions, solution, orders)

    def along(direction: Float[Array, " n"]) -> Complex[Array, "D C K"]:
        tangent = _tangent(p, names, direction)
        change: Array = jax.jvp(seen, (dict(p), at), (tangent, moved_along(tangent)))[1]
        return change

    return along


def trajectory_sensitivities(
    model: QuarterCar, p: Values, solution: PeriodicSolution, names: tuple[str, ...]
) -> Trajectory:
    """Derivatives of the trajectory itself in the named parameters, each field with a leading axis (n,)."""
    moved_along = _linear_motion(model, p, solution)
    directions = jnp.eye(len(names))
    return jax.lax.map(lambda direction: moved_along(_tangent(p, names, direction)), directions)


def _tangent(p: Values, names: tuple[str, ...], direction: Array) -> dict[str, Array]:
    return {name: jnp.zeros_like(p[name]) for name in p} | dict(zip(names, direction, strict=True))


def _linear_motion(
    model: QuarterCar, p: Values, solution: PeriodicSolution
) -> Callable[[dict[str, Array]], Trajectory]:
    """The change of the trajectory that a change of the parameters brings about."""
    at, inputs = solution.trajectory, inputs_at(solution.excitation, solution.mesh)
    parts, respond = (*at.x, *at.y), linear_response(model, p, solution)

    def moved(tangent: dict[str, Array]) -> Trajectory:
        _, change = jax.jvp(
            lambda q: residual_at_nodes(model, q, model.curves(q), parts, inputs), (dict(p),), (tangent,)
        )
        return respond(change)

    return moved


def linear_response(
    model: QuarterCar, p: Values, solution: PeriodicSolution
) -> Callable[[Float[Array, "k P"]], Trajectory]:
    """The change of the trajectory that a change of the residual at the nodes, (2 + s, P), brings about."""
    lin, at, layout = solution.linearised, solution.trajectory, solution.mesh.layout
    steps = _steps(solution.excitation, solution.mesh)
    still = Trajectory(jnp.zeros_like(at.x), jnp.zeros_like(at.y))

    def respond(change: Float[Array, "k P"]) -> Trajectory:
        imbalance = -solve_nodes(lin.mass, change[:, None])[:, 0]
        rate = jnp.concatenate([jnp.zeros_like(at.x[2:4]), imbalance])
        return solve_linearised(layout, lin, step_defects(model, still, rate, layout, steps), imbalance)

    return respond


def truncation_error(
    model: QuarterCar, p: Values, solution: PeriodicSolution, orders: int
) -> Float[Array, "D C"]:
    """Largest change of any order 1..orders when the nodes are doubled, relative to the first harmonic.

    The error of ``solution`` itself is about four thirds of it (the rule is of second order).
    """
    doubled = Layout(tuple(2 * count for count in solution.mesh.layout.counts))
    finer = adapt(model, p, solution, doubled, PeriodicSettings.iterations)
    coarse, fine = (harmonics(model, p, each, orders) for each in (solution, finer))
    return jnp.max(jnp.abs(coarse - fine)[..., 1:], axis=-1) / jnp.abs(fine[..., 1])
