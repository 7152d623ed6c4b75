"""Static equilibrium: where the rig stands when nothing moves.

It is the root of the residual without velocities and accelerations. Frictions carry nothing then: their
internal states are among the unknowns. Suspension deflection is counted from the equilibrium at the nominal
link angle, as a recording counts it from its standstill.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.model.dynamics import Coordinates, Motion
from savgs_ident.model.inputs import Inputs
from savgs_ident.model.kinematics import suspension_travel
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.section import SectionCurves
from savgs_ident.model.small_root import find_root
from savgs_ident.model.strut import Link
from savgs_ident.model.tyre import Road
from savgs_ident.model.values import Values

PRECISION = 1e-9
"""Relative precision of an equilibrium; forces of 1e7 N/m leave no more."""

COORDINATE_SCALE = (1e-2, 3e-2)
"""Typical displacements of z_s [m] and theta_LW [rad]."""


class Equilibrium(NamedTuple):
    """Coordinates and internal states (s,) at rest, and the force [N] with which the strut pushes apart."""

    q: Coordinates
    s: Float[Array, " s"]
    strut: Float[Array, ""]


def _at_rest(q: Coordinates) -> Motion:
    still = Coordinates(jnp.zeros_like(q.z_s), jnp.zeros_like(q.theta_LW))
    return Motion(q, still, still)


def static_equilibrium(
    model: QuarterCar,
    p: Values,
    link_angle: Float[Array, ""],
    road_height: Float[Array, ""],
    curves: SectionCurves | None = None,
) -> Equilibrium:
    """Where the rig rests at a link angle [rad] and a height of the plate [m]; NaN if it finds no rest.

    ``curves`` of the same parameters serve as in :meth:`QuarterCar.residual`. Differentiable in everything,
    exactly.
    """
    zero = jnp.zeros_like(link_angle)
    inputs = Inputs(Road(road_height, zero), Link(link_angle, zero))
    states = [state.scale for state in model.states]

    def residual(x: Array) -> Array:
        still = jnp.zeros_like(x[2:])
        return model.residual(p, _at_rest(Coordinates(x[0], x[1])), x[2:], still, inputs, curves)

    scale = jnp.asarray([*COORDINATE_SCALE, *states])
    # At rest a velocity among the states has nothing on the diagonal: rows have to be exchanged.
    x = find_root(residual, jnp.zeros(2 + len(states)), scale, PRECISION, jnp.linalg.solve)
    q = Coordinates(x[0], x[1])
    still = jnp.zeros_like(x[2:])
    return Equilibrium(q, x[2:], model.loads(p, _at_rest(q), x[2:], still, inputs, curves).strut)


def deflection_zero(model: QuarterCar, p: Values, curves: SectionCurves | None = None) -> Float[Array, ""]:
    """Suspension travel from the drawing [m] at which a recorded deflection is zero.

    That is at standstill with the link at its nominal angle.
    """
    nominal = jnp.asarray(p["psi_nominal"])
    rest = static_equilibrium(model, p, nominal, jnp.zeros_like(nominal), curves)
    return suspension_travel(p, rest.q.theta_LW)
