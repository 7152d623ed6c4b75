"""Periodic steady states of all dwells at once.

A dwell's motion is periodic but not smooth: the rail sticks at every reversal. The motion is found by
periodic collocation in time (:mod:`savgs_ident.simulate.collocation`): a coarse, evenly spaced solution shows
where the accelerations change, the nodes move there, and the solution is repeated on them. The nodes then
serve any nearby parameter set, which is how fits warm-start.

    solution = simulate_periodic(plant, p, excitation)

:mod:`savgs_ident.simulate.harmonics` says what sensors read along it, and
:mod:`savgs_ident.simulate.sensitivity` how that changes with the parameters.
"""

from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int
from numpy.typing import NDArray

from savgs_ident.core.status import Status
from savgs_ident.core.values import Values, as_values
from savgs_ident.plants.base import AbstractPlant, Excitation
from savgs_ident.simulate.collocation import (
    Linearised,
    Trajectory,
)
from savgs_ident.simulate.excitation import inputs_at, signals_at
from savgs_ident.simulate.mesh import Layout, Mesh, adapted_mesh, layout_for, uniform_mesh
from savgs_ident.simulate.newton import TOLERANCE, motion_scale, newton_structure, solve_newton
from savgs_ident.simulate.program_cache import placed, stored

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

    ``last_step`` is the last Newton step of each dwell relative to the size of its motion [1], (D,);
    ``travel`` is the largest displacement of each coordinate for which the equations hold [its unit], (n,).
    """

    excitation: Excitation
    mesh: Mesh
    trajectory: Trajectory
    linearised: Linearised
    last_step: Float[Array, " D"]
    iterations: Int[Array, ""]
    travel: tuple[float, ...] = eqx.field(static=True)

    def status(self) -> tuple[Status, ...]:
        """How each dwell ended; a motion beyond a coordinate's travel counts as not finite."""
        step = np.asarray(self.last_step)
        finite, small = np.isfinite(step) & self._within_travel(), step <= TOLERANCE
        return tuple(
            Status.CONVERGED if ok and done else Status.MAX_ITERATIONS if ok else Status.NOT_FINITE
            for ok, done in zip(finite, small, strict=True)
        )

    def _within_travel(self) -> NDArray[np.bool_]:
        limits = np.asarray(self.travel)[:, None]
        inside = np.all(np.abs(np.asarray(self.trajectory.x[: len(limits)])) <= limits, axis=0)
        return np.logical_and.reduceat(inside, self.mesh.layout.starts)


def node_steps(excitation: Excitation, mesh: Mesh) -> Float[Array, " P"]:
    """Time from each node to the next [s]."""
    return jnp.asarray(mesh.gap) / (2.0 * jnp.pi * excitation.frequency[mesh.layout.dwell])


def solve_on_mesh(
    model: AbstractPlant, p: Values, excitation: Excitation, mesh: Mesh, start: Trajectory, limit: int
) -> PeriodicSolution:
    """Newton's method on given nodes from a given start."""
    bounds = jnp.asarray(limit), jnp.asarray(TOLERANCE)
    p, excitation, mesh, start, bounds = placed((p, excitation, mesh, start, bounds))
    parts = _solved(model, p, excitation, mesh, start, *bounds)
    trajectory, linearised, last_step, iterations = jax.tree.unflatten(newton_structure(), parts)
    travel = tuple(each.travel for each in model.coordinates)
    return PeriodicSolution(excitation, mesh, trajectory, linearised, last_step, iterations, travel=travel)


@eqx.filter_jit
def _solved(*args: Any) -> tuple[Array, ...]:
    return stored(_solve, *args)


def _solve(
    model: AbstractPlant,
    p: Values,
    excitation: Excitation,
    mesh: Mesh,
    start: Trajectory,
    limit: Array,
    enough: Array,
) -> tuple[Array, ...]:
    signals, turning = signals_at(model, excitation, mesh)
    layout, steps = mesh.layout, node_steps(excitation, mesh)
    scale = motion_scale(model, signals, excitation.frequency, layout)
    u = model.drive(signals, turning)
    return tuple(jax.tree.leaves(solve_newton(model, p, start, u, layout, steps, scale, limit, enough)))


def solve_near(
    model: AbstractPlant, p: Values, known: PeriodicSolution, start: Trajectory, limit: int, enough: float
) -> tuple[Trajectory, Float[Array, ""]]:
    """Motions on the nodes of a ``known`` solution from a close ``start``, and their last relative step [1].

    To be a part of a larger program that is compiled. Look at the step: it is above ``enough`` where ``limit``
    iterations were too few.
    """
    bounds = jnp.asarray(limit), jnp.asarray(enough)
    parts = _solve(model, p, known.excitation, known.mesh, start, *bounds)
    found = jax.tree.unflatten(newton_structure(), parts)
    return found.trajectory, jnp.max(found.last_step)


@eqx.filter_jit
def _cold_start(model: AbstractPlant, excitation: Excitation, mesh: Mesh) -> Trajectory:
    q, qd, states = model.cold_start(inputs_at(model, excitation, mesh))
    x = jnp.stack([*q, *qd, *states])
    return Trajectory(x, jnp.zeros((len(q) + len(states), x.shape[1])))


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
    model: AbstractPlant, p: Values, solution: PeriodicSolution, layout: Layout, limit: int
) -> PeriodicSolution:
    """The solution again, on nodes that follow its accelerations."""
    accelerations = np.asarray(solution.trajectory.y[: len(model.coordinates)])
    if not np.isfinite(accelerations).all():
        return solution
    frequency = np.asarray(solution.excitation.frequency)
    mesh = adapted_mesh(solution.mesh, accelerations, frequency, layout)
    start = _carry_over(solution.trajectory, solution.mesh, mesh)
    return solve_on_mesh(model, as_values(p), solution.excitation, mesh, start, limit)


def simulate_periodic(
    model: AbstractPlant,
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
    start = _cold_start(model, excitation, mesh)
    first, *later = [COARSE] * settings.adaptations + [settings.iterations]
    solution = solve_on_mesh(model, p, excitation, mesh, start, first)
    for limit in later:
        solution = adapt(model, p, solution, layout, limit)
    return solution


def resolve(
    model: AbstractPlant,
    p: Values,
    solution: PeriodicSolution,
    limit: int = PeriodicSettings.iterations,
    start: Trajectory | None = None,
) -> PeriodicSolution:
    """The solution at other parameters, on the same nodes, started from ``solution`` or a better ``start``."""
    begin = solution.trajectory if start is None else start
    return solve_on_mesh(model, as_values(p), solution.excitation, solution.mesh, begin, limit)
