"""The equations of one point, told to CasADi: the model's residual, and what the sensors read."""

import casadi as ca
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from savgs_ident.fit.collocation.unknowns import Unknowns
from savgs_ident.fit.problem import Problem
from savgs_ident.model.dynamics import Coordinates, Motion
from savgs_ident.model.inputs import Inputs
from savgs_ident.model.strut import Link
from savgs_ident.model.tyre import Road
from savgs_ident.symbolic.translate import to_casadi


def point_equations(problem: Problem, unknowns: Unknowns) -> ca.Function:
    """(z, u, drive) -> equations, all in units of their typical sizes.

    ``z`` are the unknowns of a point, ``u`` the parameters' coordinates, ``drive`` road height [m] and velocity
    [m/s], link angle [rad] and velocity [rad/s].
    """
    states, partners = unknowns.states, unknowns.partners

    def equations(z: Array, u: Array, drive: Array) -> Array:
        here = jnp.asarray(unknowns.scale) * z
        x, y, readings = jnp.split(here, [states, states + partners])
        p = problem.parameters(u)
        motion = Motion(Coordinates(x[0], x[1]), Coordinates(x[2], x[3]), Coordinates(y[0], y[1]))
        inputs = Inputs(Road(drive[0], drive[1]), Link(drive[2], drive[3]))
        balance = problem.model.residual(p, motion, x[4:], y[2:], inputs)
        seen = jnp.stack(problem.model.read(p, x[1], y[0]))
        return jnp.concatenate([balance, seen - readings]) / jnp.asarray(unknowns.residual_scale)

    inputs = {"z": np.zeros(unknowns.width), "u": np.zeros(unknowns.parameters), "drive": np.zeros(4)}
    return to_casadi("point", equations, inputs, ["equations"])
