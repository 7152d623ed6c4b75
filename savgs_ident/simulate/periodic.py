"""Periodic steady states of all dwells at once.

    solution = simulate_periodic(plant, p, excitation)
    response = harmonics(plant, p, solution, orders=9)   # complex, (dwells, channels, 10)

What the sensors read along them is in :mod:`savgs_ident.simulate.readings`.

A dwell's motion is periodic but not smooth: the rail sticks at every reversal. The motion is found by
periodic collocation in time (:mod:`savgs_ident.simulate.collocation`): a coarse, evenly spaced solution shows
where the accelerations change, the nodes move there, and the solution is repeated on them. The nodes then
serve any nearby parameter set, which is how fits warm-start.

Newton's iteration is damped, and on all dwells at once. Each dwell has its own damping: where a step is longer than
the one before it (a friction that sticks now here, now there), the next ones are shortened; where steps shrink they
are taken whole again.

What the truncation to a finite number of nodes costs shows in the solution on twice as many (:func:`adapt`): the
rule is of second order. How the response changes with the parameters is in :mod:`savgs_ident.simulate.sensitivity`.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.tree_util import PyTreeDef
from jaxtyping import Array, Float, Int
from numpy.typing import NDArray

from savgs_ident.core.status import Status
from savgs_ident.core.values import Values, as_values
from savgs_ident.plants.at_rest import find_rest
from savgs_ident.plants.base import AbstractPlant, Excitation, scale_of_time
from savgs_ident.simulate.collocation import (
    CyclicFactors,
    Linearised,
    Steps,
    Trajectory,
    blank_linearised,
    linearise,
    solve_linearised,
    step_defects,
)
from savgs_ident.simulate.excitation import inputs_at, motion_scale, only_driven, signals_at
from savgs_ident.simulate.march import march
from savgs_ident.simulate.mesh import (
    CHUNK,
    Layout,
    Mesh,
    NodeOrder,
    adapted_mesh,
    layout_for,
    only_dwells,
    over_dwells,
    places_between,
    uniform_mesh,
)
from savgs_ident.simulate.program_cache import placed, run_cached

TOLERANCE = 1e-7
"""Largest last Newton step, relative to the size of the motion: the error left is far smaller."""

TRUST = 0.5
"""Longest step of the coordinates taken at a time, relative to the size of the motion.

Internal states go with it as far as that takes them: what swings in resonance moves many times as far as its plant.
"""

LEAST_SHARE = 1.0 / 8.0
"""The strongest damping."""


class NewtonResult(NamedTuple):
    """A trajectory, its linearisation, the last relative step of each dwell [1], (D,), and iterations used."""

    trajectory: Trajectory
    linearised: Linearised
    last_step: Float[Array, " D"]
    iterations: Int[Array, ""]


def newton_structure() -> PyTreeDef:
    """How the arrays of a result belong together."""
    zero = jnp.zeros(())
    factors = CyclicFactors(Steps(zero, zero, zero), zero, zero, zero)
    result = NewtonResult(Trajectory(zero, zero), Linearised(zero, zero, factors), zero, zero)
    return jax.tree.structure(result)


class _Progress(NamedTuple):
    result: NewtonResult
    share: Float[Array, " D"]


def node_rates(model: AbstractPlant, at: Trajectory, imbalance: Float[Array, "k P"]) -> Float[Array, "m P"]:
    """xd = (qd, y + imbalance), in SI per second."""
    n = len(model.coordinates)
    return jnp.concatenate([at.x[n : 2 * n], at.y + imbalance])


def _newton_step(
    model: AbstractPlant, p: Values, prepared: Any, at: Trajectory, u: Any, layout: NodeOrder, steps: Array
) -> tuple[Trajectory, Linearised]:
    lin = linearise(model, p, prepared, at, u, layout, steps)
    rate = node_rates(model, at, lin.imbalance)
    return solve_linearised(layout, lin, step_defects(model, at, rate, layout, steps), lin.imbalance), lin


def solve_newton(
    model: AbstractPlant,
    p: Values,
    prepared: Any,
    start: Trajectory,
    u: Any,
    layout: NodeOrder,
    steps: Float[Array, " P"],
    scale: Float[Array, "m P"],
    limit: Int[Array, ""],
    enough: Float[Array, ""],
) -> NewtonResult:
    """Iterate until every dwell's step is below ``enough`` or ``limit`` iterations are used.

    ``steps`` [s] lead from node to node, ``scale`` is the size of each state [its unit]; a step counts
    relative to it [1].
    """
    coordinates = 2 * len(model.coordinates)

    def advance(progress: _Progress) -> _Progress:
        before = progress.result
        at = before.trajectory
        change, lin = _newton_step(model, p, prepared, at, u, layout, steps)
        relative = jnp.abs(change.x) / scale
        length, moved = (
            # A dwell of a part of a layout may have no nodes.
            jnp.maximum(over_dwells(jnp.max(each, axis=0), layout), 0.0)
            for each in (relative, relative[:coordinates])
        )
        damped = jnp.maximum(progress.share / 2.0, LEAST_SHARE)
        share = jnp.where(length > before.last_step, damped, jnp.minimum(1.0, 2.0 * progress.share))
        taken = jnp.minimum(share, TRUST / moved)[layout.dwell]
        there = Trajectory(at.x + taken * change.x, at.y + taken * change.y)
        return _Progress(NewtonResult(there, lin, length, before.iterations + 1), share)

    def unfinished(progress: _Progress) -> Array:
        step = progress.result.last_step
        return jnp.any(step > enough) & jnp.all(jnp.isfinite(step)) & (progress.result.iterations < limit)

    blank = blank_linearised(model, layout)
    far = jnp.full(len(layout.chunk_table), np.finfo(np.float64).max)
    begin = _Progress(NewtonResult(start, blank, far, jnp.zeros((), int)), jnp.ones_like(far))
    return jax.lax.while_loop(unfinished, advance, begin).result


COARSE = 10
"""Iterations on nodes that are to move: enough to show where, whether or not all dwells have converged."""


@dataclass(frozen=True)
class PeriodicSettings:
    """How finely to solve.

    ``nodes`` per period, more in proportion to the period of dwells below ``slow`` [Hz]; in windows of tests that do
    not repeat ``window_rate`` a second [Hz], both for a plant whose time scale is 1; ``adaptations`` of the nodes to
    the solution; at most ``iterations`` of Newton's method on the last nodes.
    """

    nodes: int = 256
    window_rate: float = 540.0
    slow: float = 1.4
    adaptations: int = 2
    iterations: int = 60


def layout_of(excitation: Excitation, settings: PeriodicSettings, model: AbstractPlant) -> Layout:
    """How many nodes each test has."""
    frequency = np.asarray(excitation.frequency) * scale_of_time(model)
    counts = np.array(layout_for(frequency, settings.nodes, settings.slow).counts)
    windows = excitation.windows
    counts[windows] = CHUNK * np.ceil(settings.window_rate / frequency[windows] / CHUNK)
    return Layout(tuple(counts.tolist()), excitation.opened)


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
        inside = np.all(np.abs(np.asarray(self.trajectory.x)[: len(limits)]) <= limits, axis=0)
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
    # Apart from the program, which would compile it again for every model.
    prepared = model.prepare(p)
    parts = _solved(model, p, prepared, excitation, mesh, start, *bounds)
    trajectory, linearised, last_step, iterations = jax.tree.unflatten(newton_structure(), parts)
    travel = tuple(each.travel for each in model.coordinates)
    return PeriodicSolution(excitation, mesh, trajectory, linearised, last_step, iterations, travel=travel)


@eqx.filter_jit
def _solved(*args: Any) -> tuple[Array, ...]:
    return run_cached(_solve, *args)


def _solve(
    model: AbstractPlant,
    p: Values,
    prepared: Any,
    excitation: Excitation,
    mesh: Mesh,
    start: Trajectory,
    limit: Array,
    enough: Array,
) -> tuple[Array, ...]:
    signals, turning = signals_at(model, excitation, mesh)
    layout, steps = mesh.layout, node_steps(excitation, mesh)
    scale = motion_scale(model, signals, excitation, layout)
    u = model.drive(signals, turning)
    result = solve_newton(model, p, prepared, start, u, layout, steps, scale, limit, enough)
    return tuple(jax.tree.leaves(result))


def blank_solution(model: AbstractPlant, excitation: Excitation, layout: Layout) -> PeriodicSolution:
    """What a solution looks like, of zeros: to have the programs compiled that take one."""
    lin = blank_linearised(model, layout)
    inner, size = lin.factors.steps.lower.shape[1:3]
    nodes = layout.total
    blank = PeriodicSolution(
        excitation=excitation,
        mesh=uniform_mesh(layout),
        trajectory=Trajectory(jnp.zeros((size, nodes)), jnp.zeros((inner, nodes))),
        linearised=lin,
        last_step=jnp.zeros(len(layout.counts)),
        iterations=jnp.zeros((), int),
        travel=tuple(each.travel for each in model.coordinates),
    )
    return cast(PeriodicSolution, placed(blank))


@eqx.filter_jit
def _cold_start(model: AbstractPlant, excitation: Excitation, mesh: Mesh) -> Trajectory:
    q, qd, states = model.cold_start(inputs_at(model, excitation, mesh))
    x = jnp.stack([*q, *qd, *states])
    return Trajectory(x, jnp.zeros((len(q) + len(states), x.shape[1])))


def _with_windows_marched(
    model: AbstractPlant, p: Values, excitation: Excitation, mesh: Mesh, start: Trajectory
) -> Trajectory:
    """The start of all tests, that of the windows followed in time from their first instant."""
    windows = excitation.windows
    theirs, nodes = only_dwells(mesh, windows), mesh.layout.nodes_of(windows)
    opened = mesh.layout.starts[list(mesh.layout.opened)]
    if opened.size:
        start = start._replace(x=_resting(model, p, excitation, mesh, start.x, opened))
    start = with_initial_states(start, excitation, mesh.layout)
    first = start.x[:, mesh.layout.starts[windows]]
    marched = march(model, p, model.prepare(p), only_driven(excitation, windows), theirs, first)
    return Trajectory(
        *(
            known.at[:, nodes].set(new).at[:, opened].set(known[:, opened])
            for known, new in zip(start, marched, strict=True)
        )
    )


def with_initial_states(at: Trajectory, excitation: Excitation, layout: Layout) -> Trajectory:
    """A trajectory with the states with which tests begin that do not begin at rest, where they are known."""
    if excitation.initial_states is None:
        return at
    places, count = excitation.moving, excitation.initial_states.shape[1]
    return at._replace(x=at.x.at[:count, layout.starts[places]].set(excitation.initial_states[places].T))


@eqx.filter_jit
def _resting(
    model: AbstractPlant,
    p: Values,
    excitation: Excitation,
    mesh: Mesh,
    x: Float[Array, "m P"],
    places: NDArray[np.intp],
) -> Float[Array, "m P"]:
    """States [SI] with those at some nodes as the plant rests there under its inputs, where such a rest is found."""
    prepared = model.prepare(p)

    def rest(u: Any, known: Array) -> Array:
        q, s, root = find_rest(model, p, u, prepared)
        found = jnp.concatenate([jnp.stack([*q]), jnp.zeros(len(q)), s])
        return jnp.where(root.step_left <= root.precision, found, known)

    inputs = jax.tree.map(lambda each: each[places], inputs_at(model, excitation, mesh))
    return x.at[:, places].set(jax.vmap(rest, in_axes=(0, 1), out_axes=1)(inputs, x[:, places]))


def _carry_over(trajectory: Trajectory, old: Mesh, new: Mesh) -> Trajectory:
    """A trajectory known on old nodes, at new ones, by linear interpolation."""
    before, share = places_between(old, new)
    after = old.layout.following[before]

    def moved(values: NDArray[np.float64]) -> NDArray[np.float64]:
        left = values[:, before]
        return left + share * (values[:, after] - left)

    return Trajectory(*(jnp.asarray(moved(np.asarray(part))) for part in trajectory))


def adapt(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, layout: Layout, limit: int
) -> PeriodicSolution:
    """The solution again, on nodes that follow its accelerations."""
    accelerations = np.asarray(solution.trajectory.y)[: len(model.coordinates)]
    if not np.isfinite(accelerations).all():
        return solution
    frequency = np.asarray(solution.excitation.frequency) * scale_of_time(model)
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
        layout = layout_of(excitation, settings, model)
    mesh = uniform_mesh(layout)
    start = _cold_start(model, excitation, mesh)
    if excitation.windows.size:
        start = _with_windows_marched(model, p, excitation, mesh, start)
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
