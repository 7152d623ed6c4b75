"""How periodic motions and their harmonics change, to first order, by the implicit function theorem.

They change with the parameters and with signals imposed at the plant's ports. A solution keeps the factorisation of
its last Newton step: one more direction costs one more back substitution.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float
from numpy.typing import NDArray

from savgs_ident.core.values import Values
from savgs_ident.effects.composition import nothing_imposed
from savgs_ident.plants.base import AbstractPlant, AtPorts
from savgs_ident.responses.harmonic_response import ComparedPart
from savgs_ident.simulate.collocation import (
    Trajectory,
    apply_nodes,
    changed_initial_states,
    node_motion,
    residual_at_nodes,
    solve_linearised,
    step_defects,
)
from savgs_ident.simulate.excitation import inputs_at, signals_at
from savgs_ident.simulate.mesh import Mesh
from savgs_ident.simulate.periodic import PeriodicSolution, node_steps
from savgs_ident.simulate.program_cache import compiled_quickly, first_alone, placed, run_cached
from savgs_ident.simulate.readings import Sensors, harmonics_of, readings_of, sensors_of, shown_by


class Directions(NamedTuple):
    """Directions of the parameters, k of them, and what they do to what a plant prepares from the parameters.

    Attributes:
        tangents: change of each parameter along every direction [its unit], (k,).
        prepared: what :meth:`AbstractPlant.prepare` gives.
        changes: its change along every direction, with a leading axis (k,).
        wanted: how many of them are wanted, the first ones; what comes along the others is zero.
    """

    tangents: dict[str, Array]
    prepared: Any
    changes: Any
    wanted: Array


def directions_of(
    model: AbstractPlant, p: Values, tangents: Mapping[str, Float[Array, " k"]], count: int
) -> Directions:
    """Directions that change all parameters by ``tangents`` [their units], ``count`` of which are wanted.

    What is prepared has programs of its own, which serve any effects of the plant.
    """

    def prepared(tangent: dict[str, Array]) -> tuple[Any, Any]:
        found: tuple[Any, Any] = jax.jvp(model.prepare, (dict(p),), (tangent,))
        return found

    changes = jax.vmap(prepared, out_axes=(None, 0))(dict(tangents))
    return Directions(dict(tangents), *changes, jnp.asarray(count))


def unit_tangents(p: Values, names: Sequence[str], count: int) -> dict[str, NDArray[np.float64]]:
    """Changes by one of each named parameter in turn, (count,) for all parameters; no change where none is left."""
    tangents = {name: np.zeros(count) for name in p}
    for place, name in enumerate(names):
        tangents[name][place] = 1.0
    return tangents


def harmonic_sensitivities(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, names: Sequence[str], orders: int
) -> Complex[Array, "n D C K"]:
    """Derivatives of the harmonics 0..orders of the sensor readings in the named parameters.

    They are in the unit of the reading per unit of the parameter.
    """
    return harmonics_with_sensitivities(model, p, solution, names, orders)[1]


def harmonics_with_sensitivities(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, names: Sequence[str], orders: int
) -> tuple[Complex[Array, "D C K"], Complex[Array, "n D C K"]]:
    """Harmonics 0..orders of the sensor readings, and their derivatives, by the same programs for all who ask.

    They are in the unit of the reading, and per unit of the parameter.
    """
    p, solution = placed((dict(p), solution))
    order = sorted(p)
    places = placed(jnp.asarray(np.array([order.index(name) for name in names], np.int64)))
    wanted = placed(jnp.asarray(len(names)))
    return _by_places(model, p, solution, places, wanted, orders)


def rehearse_sensitivities(
    model: AbstractPlant, p: Values, blank: PeriodicSolution, names: Sequence[str], orders: int
) -> None:
    """Have the programs of these compiled, on a :func:`blank_solution`; no derivative is computed."""
    p, blank = placed((dict(p), blank))
    places, nothing = placed((jnp.zeros(len(names), int), jnp.asarray(0)))
    _by_places(model, p, blank, places, nothing, orders)


def _by_places(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, places: Array, wanted: Array, orders: int
) -> tuple[Array, Array]:
    """Harmonics, and their derivatives in the first ``wanted`` of the parameters at ``places`` among sorted names."""
    prepared = placed(model.prepare(p))
    # Apart from what moves: of few numbers, so it need not be compiled with care.
    flat = first_alone(_changes_of_prepared, model, p, places)
    changes = jax.tree.unflatten(jax.tree.structure(prepared), flat)
    return first_alone(_seen_with_changes, model, p, solution, places, wanted, prepared, changes, orders)


@compiled_quickly
def _changes_of_prepared(*args: Any) -> tuple[Array, ...]:
    return run_cached(_flat_changes, *args)


def _flat_changes(model: AbstractPlant, p: Values, places: Array) -> tuple[Array, ...]:
    """Changes of what a plant prepares from its parameters, by each of those at ``places``, (w, ...) each."""
    changes = directions_of(model, p, _unit_tangents_at(p, places), places.size).changes
    return tuple(jax.tree.leaves(changes))


def _unit_tangents_at(p: Values, places: Array) -> dict[str, Array]:
    return {name: 1.0 * (places == place) for place, name in enumerate(sorted(p))}


@eqx.filter_jit
def _seen_with_changes(*args: Any) -> tuple[Array, Array]:
    seen, changes = run_cached(_harmonics_and_changes, *args)
    return seen, changes


def _harmonics_and_changes(
    model: AbstractPlant,
    p: Values,
    solution: PeriodicSolution,
    places: Array,
    wanted: Array,
    prepared: Any,
    changes: Any,
    orders: int,
) -> tuple[Array, Array]:
    directions = Directions(_unit_tangents_at(p, places), prepared, changes, wanted)
    seen, changes = seen_along(model, p, solution, orders, directions)
    part, mesh = solution.excitation.part, solution.mesh
    shown = shown_along(seen, changes, directions.wanted, part, mesh)
    return shown_by(seen.sensors, seen.readings, part, mesh), shown


class Seen(NamedTuple):
    """What sensors without dynamics read at the nodes, (P, C), each in its unit, and the sensors."""

    readings: Float[Array, "P C"]
    sensors: Sensors


def seen_along(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, orders: int, directions: Directions
) -> tuple[Seen, Seen]:
    """What is seen of a motion, and its changes along k directions of the parameters, with a leading axis (k,)."""
    at = solution.trajectory
    moved_along = _linear_motion(model, p, solution, directions.prepared)

    def see(q: dict[str, Array], motions: Trajectory) -> Seen:
        sensors = sensors_of(model, q, solution.excitation, orders)
        return Seen(readings_of(model, q, motions, solution), sensors)

    def change(given: tuple[dict[str, Array], Any]) -> Seen:
        moved: Seen = jax.jvp(see, (dict(p), at), (given[0], moved_along(*given)))[1]
        return moved

    seen, given = see(dict(p), at), (directions.tangents, directions.changes)
    return seen, along_first(change, given, directions.wanted, seen)


def shown_along(
    seen: Seen,
    changes: Seen,
    wanted: Array,
    part: ComparedPart | None,
    mesh: Mesh,
    kept: Callable[[Array], Array] = lambda each: each,
) -> Array:
    """Changes of what sensors show, (k, ...), where what they see changes; what is ``kept`` of each harmonics."""

    def shown(each: Seen) -> Array:
        return kept(shown_by(each.sensors, each.readings, part, mesh))

    def change(given: Seen) -> Array:
        moved: Array = jax.jvp(shown, (seen,), (given,))[1]
        return moved

    return along_first(change, changes, wanted, jax.eval_shape(shown, seen), ANALYSED)


TOGETHER = 2
"""Directions that are solved for in one pass: more of them leave the processor's nearest memory."""

ANALYSED = 16
"""Directions whose harmonics are summed in one pass: one table of waves, which takes long to make, serves all."""


def along_first(
    one: Callable[[Any], Any], given: Any, wanted: Array, like: Any, together: int = TOGETHER
) -> Any:
    """What ``one`` gives of each of k things ``given``, ``together`` in a pass, with a leading axis (k,).

    All but the first ``wanted`` may be left zero. Each is like ``like``, in shapes and types: to find them out takes
    as long as to trace ``one``.
    """
    size = jax.tree.leaves(given)[0].shape[0]
    width = max(1, min(together, size))

    def some(place: Array, known: Any) -> Any:
        first = jnp.minimum(place * width, size - width)
        part = jax.tree.map(lambda each: jax.lax.dynamic_slice_in_dim(each, first, width), given)
        return jax.tree.map(
            lambda all_, new: jax.lax.dynamic_update_slice_in_dim(all_, new, first, 0),
            known,
            jax.vmap(one)(part),
        )

    passes = (wanted + width - 1) // width
    blank = jax.tree.map(lambda each: jnp.zeros((size, *each.shape), each.dtype), like)
    return jax.lax.fori_loop(0, passes, some, blank)


def trajectory_sensitivities(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, names: tuple[str, ...]
) -> Trajectory:
    """Derivatives of the trajectory itself in the named parameters, each field with a leading axis (n,)."""
    tangents = jax.tree.map(jnp.asarray, unit_tangents(p, names, len(names)))
    directions = directions_of(model, p, tangents, len(names))
    moved_along = _linear_motion(model, p, solution, directions.prepared)
    given = directions.tangents, directions.changes
    trajectories: Trajectory = along_first(
        lambda each: moved_along(*each), given, directions.wanted, solution.trajectory
    )
    return trajectories


def _linear_motion(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, prepared: Any
) -> Callable[[dict[str, Array], Any], Trajectory]:
    """The change of the trajectory by one of the parameters and of what is prepared from them."""
    at, u = solution.trajectory, inputs_at(model, solution.excitation, solution.mesh)
    parts, respond = (*at.x, *at.y), linear_response(model, p, solution)

    def residual(q: dict[str, Array], prepared: Any) -> Array:
        return residual_at_nodes(model, q, prepared, parts, u)

    def moved(tangent: dict[str, Array], change: Any) -> Trajectory:
        return respond(jax.jvp(residual, (dict(p), prepared), (tangent, change))[1])

    return moved


def linear_response(
    model: AbstractPlant, p: Values, solution: PeriodicSolution
) -> Callable[[Float[Array, "k P"]], Trajectory]:
    """The change of the trajectory that a change of the residual at the nodes, (k, P), brings about, in SI."""
    lin, at, layout = solution.linearised, solution.trajectory, solution.mesh.layout
    steps = node_steps(solution.excitation, solution.mesh)
    still, n = Trajectory(jnp.zeros_like(at.x), jnp.zeros_like(at.y)), len(model.coordinates)

    def respond(change: Float[Array, "k P"]) -> Trajectory:
        imbalance = -apply_nodes(lin.per_residual, change)
        rate = jnp.concatenate([jnp.zeros_like(at.x[n : 2 * n]), imbalance])
        return solve_linearised(layout, lin, step_defects(model, still, rate, layout, steps), imbalance)

    return respond


def answers(
    model: AbstractPlant, p: Values, solution: PeriodicSolution
) -> Callable[[Any], Float[Array, "P C"]]:
    """Derivatives of the readings at the nodes along signals imposed at the plant's ports, to be mapped over.

    They are given at the nodes, as :func:`nothing_imposed` arranges them.
    """
    at, mesh, prepared = solution.trajectory, solution.mesh, model.prepare(p)
    signals, turning = signals_at(model, solution.excitation, mesh)
    still = nothing_imposed(model.ports, at.x[0])
    respond = linear_response(model, p, solution)

    def residual(imposed: Any) -> Array:
        u = model.drive(signals, turning, imposed)
        return residual_at_nodes(model, p, prepared, (*at.x, *at.y), u)

    def along(imposed: Any) -> Float[Array, "P C"]:
        _, change = jax.jvp(residual, (still,), (imposed,))
        motions = respond(change)
        answer: Array = jax.jvp(lambda found: readings_of(model, p, found, solution), (at,), (motions,))[1]
        return answer

    return along


@eqx.filter_jit
def changes_by_initial_states(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, orders: int, states: int
) -> Complex[Array, "D C K m"]:
    """Changes of the harmonics 0..orders by one unit of each of the first ``states`` with which tests begin.

    They are in the unit of the reading per SI unit of the state; zero for tests of which none is estimated.
    """
    at, layout = solution.trajectory, solution.mesh.layout
    assert solution.excitation.part is not None
    moving = solution.excitation.part.begins_moving

    def along(state: Array) -> Array:
        change = jnp.zeros((at.x.shape[0], moving.size)).at[state].set(moving)
        motions = changed_initial_states(layout, solution.linearised, change)
        answer: Array = jax.jvp(
            lambda found: harmonics_of(model, p, found, solution, orders), (at,), (motions,)
        )[1]
        return answer

    return jnp.moveaxis(jax.lax.map(along, jnp.arange(states)), 0, -1)


def loads_at_nodes(model: AbstractPlant, p: Values, solution: PeriodicSolution) -> Any:
    """The plant's own record of its forces at all nodes, each (P,)."""
    return _along(model, p, solution, model.loads, None)


def ports_at_nodes(
    model: AbstractPlant,
    p: Values,
    solution: PeriodicSolution,
    imposed: Mapping[str, Array] | None = None,
) -> AtPorts:
    """What laws see at the ports, and the forces there, at all nodes, each (P,).

    What is ``imposed``, as :func:`nothing_imposed` arranges it, acts on the forces, not on the motion.
    """
    found: AtPorts = _along(model, p, solution, model.at_ports, imposed)
    return found


def _along(
    model: AbstractPlant,
    p: Values,
    solution: PeriodicSolution,
    evaluate: Callable[..., Any],
    imposed: Mapping[str, Array] | None,
) -> Any:
    at: Trajectory = solution.trajectory
    prepared = model.prepare(p)
    u = model.drive(*signals_at(model, solution.excitation, solution.mesh), imposed)

    def one(u: Any, *parts: Array) -> Any:
        motion, s, sd = node_motion(model, parts)
        return evaluate(p, motion, s, sd, u, prepared)

    return jax.vmap(one)(u, *at.x, *at.y)
