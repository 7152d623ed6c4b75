"""How periodic motions and their harmonics change with the parameters, by the implicit function theorem.

A solution keeps the factorisation of its last Newton step: one more parameter costs one more back substitution.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values
from savgs_ident.simulate.collocation import Trajectory, residual_at_nodes, solve_linearised, step_defects
from savgs_ident.simulate.cyclic import solve_nodes
from savgs_ident.simulate.excitation import inputs_at
from savgs_ident.simulate.harmonics import harmonics_of
from savgs_ident.simulate.periodic import PeriodicSolution, node_steps


@eqx.filter_jit
def harmonic_sensitivities(
    model: QuarterCar, p: Values, solution: PeriodicSolution, names: tuple[str, ...], orders: int
) -> Complex[Array, "n D C K"]:
    """Derivatives of the harmonics 0..orders of the sensor readings in the named parameters.

    They are in the unit of the reading per unit of the parameter.
    """
    return jax.lax.map(directional(model, p, solution, names, orders), jnp.eye(len(names)))


def directional(
    model: QuarterCar, p: Values, solution: PeriodicSolution, names: tuple[str, ...], orders: int
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
    """The change of the trajectory that a change of the residual at the nodes, (2 + s, P), brings about, in SI."""
    lin, at, layout = solution.linearised, solution.trajectory, solution.mesh.layout
    steps = node_steps(solution.excitation, solution.mesh)
    still = Trajectory(jnp.zeros_like(at.x), jnp.zeros_like(at.y))

    def respond(change: Float[Array, "k P"]) -> Trajectory:
        imbalance = -solve_nodes(lin.mass, change[:, None])[:, 0]
        rate = jnp.concatenate([jnp.zeros_like(at.x[2:4]), imbalance])
        return solve_linearised(layout, lin, step_defects(model, still, rate, layout, steps), imbalance)

    return respond
