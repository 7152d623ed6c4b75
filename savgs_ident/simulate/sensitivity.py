"""How periodic motions and their harmonics change, to first order, by the implicit function theorem.

They change with the parameters and with signals imposed at the plant's ports. A solution keeps the factorisation of
its last Newton step: one more direction costs one more back substitution.
"""

from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from savgs_ident.core.values import Values
from savgs_ident.effects.composition import nothing_imposed
from savgs_ident.plants.base import AbstractPlant, AtPorts
from savgs_ident.simulate.collocation import (
    Trajectory,
    node_motion,
    residual_at_nodes,
    solve_linearised,
    solve_nodes,
    step_defects,
)
from savgs_ident.simulate.excitation import inputs_at, signals_at
from savgs_ident.simulate.periodic import PeriodicSolution, harmonics_of, node_steps


@eqx.filter_jit
def harmonic_sensitivities(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, names: tuple[str, ...], orders: int
) -> Complex[Array, "n D C K"]:
    """Derivatives of the harmonics 0..orders of the sensor readings in the named parameters.

    They are in the unit of the reading per unit of the parameter.
    """
    return jax.lax.map(directional(model, p, solution, names, orders), jnp.eye(len(names)))


def directional(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, names: tuple[str, ...], orders: int
) -> Callable[[Float[Array, " n"]], Complex[Array, "D C K"]]:
    """The same along directions (n,) [units of the parameters] of the named parameters, to be mapped over."""
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
    model: AbstractPlant, p: Values, solution: PeriodicSolution, names: tuple[str, ...]
) -> Trajectory:
    """Derivatives of the trajectory itself in the named parameters, each field with a leading axis (n,)."""
    moved_along = _linear_motion(model, p, solution)
    directions = jnp.eye(len(names))
    return jax.lax.map(lambda direction: moved_along(_tangent(p, names, direction)), directions)


def _tangent(p: Values, names: tuple[str, ...], direction: Array) -> dict[str, Array]:
    return {name: jnp.zeros_like(p[name]) for name in p} | dict(zip(names, direction, strict=True))


def _linear_motion(
    model: AbstractPlant, p: Values, solution: PeriodicSolution
) -> Callable[[dict[str, Array]], Trajectory]:
    """The change of the trajectory that a change of the parameters brings about."""
    at, u = solution.trajectory, inputs_at(model, solution.excitation, solution.mesh)
    parts, respond = (*at.x, *at.y), linear_response(model, p, solution)

    def moved(tangent: dict[str, Array]) -> Trajectory:
        _, change = jax.jvp(
            lambda q: residual_at_nodes(model, q, model.prepare(q), parts, u), (dict(p),), (tangent,)
        )
        return respond(change)

    return moved


def linear_response(
    model: AbstractPlant, p: Values, solution: PeriodicSolution
) -> Callable[[Float[Array, "k P"]], Trajectory]:
    """The change of the trajectory that a change of the residual at the nodes, (k, P), brings about, in SI."""
    lin, at, layout = solution.linearised, solution.trajectory, solution.mesh.layout
    steps = node_steps(solution.excitation, solution.mesh)
    still, n = Trajectory(jnp.zeros_like(at.x), jnp.zeros_like(at.y)), len(model.coordinates)

    def respond(change: Float[Array, "k P"]) -> Trajectory:
        imbalance = -solve_nodes(lin.mass, change[:, None])[:, 0]
        rate = jnp.concatenate([jnp.zeros_like(at.x[n : 2 * n]), imbalance])
        return solve_linearised(layout, lin, step_defects(model, still, rate, layout, steps), imbalance)

    return respond


def answers(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, orders: int
) -> Callable[[Any], Complex[Array, "D C K"]]:
    """Derivatives of the harmonics along signals imposed at the plant's ports, to be mapped over.

    They are given at the nodes, as :func:`nothing_imposed` arranges them.
    """
    at, mesh, prepared = solution.trajectory, solution.mesh, model.prepare(p)
    signals, turning = signals_at(model, solution.excitation, mesh)
    still = nothing_imposed(model.ports, at.x[0])
    respond = linear_response(model, p, solution)

    def residual(imposed: Any) -> Array:
        u = model.drive(signals, turning, imposed)
        return residual_at_nodes(model, p, prepared, (*at.x, *at.y), u)

    def along(imposed: Any) -> Complex[Array, "D C K"]:
        _, change = jax.jvp(residual, (still,), (imposed,))
        motions = respond(change)
        seen = jax.jvp(lambda found: harmonics_of(model, p, found, solution, orders), (at,), (motions,))
        answer: Array = seen[1]
        return answer

    return along


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
