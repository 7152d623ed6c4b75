"""What the rig answers to signals imposed at its ports, to first order about a periodic motion."""

from collections.abc import Callable

import jax
from jaxtyping import Array, Complex

from savgs_ident.model.inputs import Imposed, Inputs, nothing_imposed
from savgs_ident.model.quarter_car import Loads, QuarterCar
from savgs_ident.model.values import Values
from savgs_ident.simulate.collocation import Trajectory, node_motion, residual_at_nodes
from savgs_ident.simulate.excitation import inputs_at
from savgs_ident.simulate.harmonics import harmonics_of
from savgs_ident.simulate.periodic import PeriodicSolution
from savgs_ident.simulate.sensitivity import linear_response


def answers(
    model: QuarterCar, p: Values, solution: PeriodicSolution, orders: int
) -> Callable[[Imposed], Complex[Array, "D C K"]]:
    """Derivatives of the harmonics along signals imposed at the nodes, each (P,) or (P, 2) and in SI.

    To be mapped over.
    """
    at, mesh = solution.trajectory, solution.mesh
    driven, curves = inputs_at(solution.excitation, mesh), model.curves(p)
    still = nothing_imposed(driven.road.height)
    respond = linear_response(model, p, solution)

    def residual(imposed: Imposed) -> Array:
        inputs = Inputs(driven.road, driven.link, driven.cam, imposed)
        return residual_at_nodes(model, p, curves, (*at.x, *at.y), inputs)

    def along(imposed: Imposed) -> Complex[Array, "D C K"]:
        _, change = jax.jvp(residual, (still,), (imposed,))
        motions = respond(change)
        seen = jax.jvp(lambda found: harmonics_of(model, p, found, solution, orders), (at,), (motions,))
        answer: Array = seen[1]
        return answer

    return along


def loads_at_nodes(model: QuarterCar, p: Values, solution: PeriodicSolution) -> Loads:
    """Forces, loads and port signals at all nodes, each (P,)."""
    at: Trajectory = solution.trajectory
    inputs, curves = inputs_at(solution.excitation, solution.mesh), model.curves(p)

    def one(inputs: Inputs, *parts: Array) -> Loads:
        motion, s, sd = node_motion(model, parts)
        return model.loads(p, motion, s, sd, inputs, curves)

    return jax.vmap(one)(inputs, *at.x, *at.y)
