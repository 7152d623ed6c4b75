"""Where a motion holds what slides: a start for internal states.

A spring that gives before it slides is dragged along by its motion. Newton's method finds where it slides and where
it sticks only node by node: from a start that slides where it should stick it takes forty iterations to come back.
Along a known motion there is nothing to look for. The anchor stays where it is until one of two bounds, which move
with the port, pushes it (the play operator), and a period later it does so again.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from savgs_ident.core.status import Status, joint_status
from savgs_ident.core.values import Values
from savgs_ident.effects.base import CREEP, DRAG_TIME, PortSignals
from savgs_ident.effects.effect import Effect
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.simulate.collocation import Trajectory
from savgs_ident.simulate.mesh import Layout, Mesh, over_dwells
from savgs_ident.simulate.periodic import PeriodicSolution, node_steps, resolve

ITERATIONS = 100
"""Most Newton steps from one point of a search to the next."""

ITERATIONS_AT_REST = 160
"""Most of them where states begin at rest: what swings on a quarter car needed 153.

Where a natural frequency falls on that of a strong test they may go round in a circle, without end.
"""

ITERATIONS_OF_A_HOLD = 6
"""Newton steps after which states that the motion holds are taken from it again.

Origin: four or five lead from there to the motion, unless it changes where they slide.
"""

FOLLOWS = 1e-3
"""By how much a state may be off what its bounds say, over their distance [1], and be kept."""


def resolve_with_states(
    model: AbstractPlant,
    p: Values,
    known: PeriodicSolution,
    signals_along: Callable[[PeriodicSolution], Mapping[str, PortSignals]],
) -> PeriodicSolution:
    """The motions of a model from those ``known``, of a model that may have other states in the last places.

    ``signals_along`` says what the force ports see along a motion, at its nodes, by the name of the port, in SI.
    """
    start = with_states_of(model, known.trajectory)
    if not any(effect.holds_states for effect in _acting(model)):
        new = start.x.shape != known.trajectory.x.shape
        return resolve(model, p, known, ITERATIONS_AT_REST if new else ITERATIONS, start)
    solution = replace(known, trajectory=start)
    for _ in range(ITERATIONS // ITERATIONS_OF_A_HOLD):
        start = with_held_states(model, p, solution, signals_along(solution))
        solution = resolve(model, p, known, ITERATIONS_OF_A_HOLD, start)
        if joint_status(solution.status()) is not Status.MAX_ITERATIONS:
            break
    return solution


def with_states_of(model: AbstractPlant, at: Trajectory) -> Trajectory:
    """A trajectory with as many states as ``model`` has, further ones at rest."""
    x, y = at
    lacking = 2 * len(model.coordinates) + len(model.states) - x.shape[0]
    if lacking <= 0:
        return Trajectory(x[: len(x) + lacking], y[: len(y) + lacking])
    rest = jnp.zeros((lacking, x.shape[1]))
    return Trajectory(jnp.concatenate([x, rest]), jnp.concatenate([y, rest]))


def with_held_states(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, signals: Mapping[str, PortSignals]
) -> Trajectory:
    """The trajectory of a solution with states as its motion holds them, for those effects whose states it holds.

    ``signals`` (P,) are what the force ports see along it. A state that follows them stays.
    """
    x = solution.trajectory.x
    steps, first = node_steps(solution.excitation, solution.mesh), len(x)
    for effect in reversed(_acting(model)):
        first -= len(effect.states)
        if effect.holds_states:
            mine = slice(first, first + len(effect.states))
            bounds = effect.bounds_of_states(p, signals[effect.port.name])
            scaled = steps / effect.port.time_scale
            x = x.at[mine].set(_held(x[mine], *bounds, scaled, solution.mesh))
    return solution.trajectory._replace(x=x)


def _acting(model: AbstractPlant) -> tuple[Effect, ...]:
    """All effects that act, those with states in the order of these."""
    return (*model.effects, *(each.acting for each in model.alternatives))


@eqx.filter_jit
def _held(
    states: Float[Array, "s P"],
    lower: Float[Array, "s P"],
    upper: Float[Array, "s P"],
    steps: Float[Array, " P"],
    mesh: Mesh,
) -> Float[Array, "s P"]:
    """The states of each test where they follow their bounds; else what does, over the second of two periods.

    ``steps`` [s] from node to node are those on a time scale of 1.
    Those of a window that begins with a given state begin without stretch.
    """
    layout, middle = mesh.layout, 0.5 * (lower + upper)
    step = steps[layout.preceding]

    def advance(before: Array, at: tuple[Array, ...]) -> tuple[Array, Array]:
        # The bristle's law by backward Euler, as the solver takes it: it creeps, and is dragged where it slides.
        lower, upper, middle, step = at
        creep, drag = CREEP * step, step / DRAG_TIME
        stuck = (before + creep * middle) / (1.0 + creep)
        now = stuck + drag / (1.0 + creep + drag) * (jnp.clip(stuck, lower, upper) - stuck)
        return now, now

    def in_time(values: Array) -> Array:
        return jnp.moveaxis(values[..., nodes], -2, 0)

    opened = list(layout.opened)
    firsts = layout.starts[opened]
    before = states[:, layout.preceding].at[:, firsts].set(states[:, firsts])
    follows, _ = advance(before, (lower, upper, middle, step))
    off = over_dwells(jnp.max(jnp.abs(states - follows) / (upper - lower), axis=0), layout)
    nodes, present = _side_by_side(layout)
    along = (*map(in_time, (lower, upper, middle)), jnp.where(present, step[nodes], 0.0))
    # What never slides creeps to where its stretch is nothing in the mean over time.
    begun, _ = jax.lax.scan(advance, _means(middle, steps, layout), along)
    begun = begun.at[:, opened].set(0.0)
    every: Array = jax.lax.scan(advance, begun, along)[1]
    anew = every[np.arange(layout.total) - layout.starts[layout.dwell], :, layout.dwell].T
    return jnp.where((off < FOLLOWS)[layout.dwell], states, anew)


def _means(values: Float[Array, "s P"], steps: Float[Array, " P"], layout: Layout) -> Float[Array, "s D"]:
    """Means over the time of each test [their units]."""
    dwells = len(layout.counts)
    whole, time = (jax.ops.segment_sum(each.T, layout.dwell, dwells) for each in (steps * values, steps))
    return whole.T / time


def _side_by_side(layout: Layout) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """The nodes of all tests, (most, D), of the shorter ones the last again, and which of them are no repetition."""
    counts = np.asarray(layout.counts)
    place = np.arange(counts.max())[:, None]
    return layout.starts + np.minimum(place, counts - 1), place < counts
