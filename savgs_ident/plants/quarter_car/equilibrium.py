"""Static equilibrium: where the rig stands when nothing moves.

Suspension deflection is counted from the equilibrium at the nominal link angle, as a recording counts it from its
standstill.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.values import Values
from savgs_ident.plants.base import find_rest, standing
from savgs_ident.plants.quarter_car.dynamics import Coordinates, SectionCurves
from savgs_ident.plants.quarter_car.kinematics import suspension_travel
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.strut import Link
from savgs_ident.plants.quarter_car.tyre import Inputs, Road


class Equilibrium(NamedTuple):
    """Coordinates and internal states (s,) at rest, and the force [N] with which the strut pushes apart."""

    q: Coordinates
    s: Float[Array, " s"]
    strut: Float[Array, ""]


def static_equilibrium(
    model: QuarterCar,
    p: Values,
    link_angle: Float[Array, ""],
    road_height: Float[Array, ""],
    prepared: SectionCurves | None = None,
) -> Equilibrium:
    """Where the rig rests at a link angle [rad] and a height of the plate [m]; NaN if it finds no rest.

    ``prepared`` serves as in :meth:`QuarterCar.residual`. Differentiable in everything, exactly.
    """
    zero = jnp.zeros_like(link_angle)
    u = Inputs(Road(road_height, zero), Link(link_angle, zero))
    q, s = find_rest(model, p, u, prepared)
    loads = model.loads(p, standing(model, q), s, jnp.zeros_like(s), u, prepared)
    return Equilibrium(q, s, loads.strut)


def deflection_zero(model: QuarterCar, p: Values, prepared: SectionCurves | None = None) -> Float[Array, ""]:
    """Suspension travel from the drawing [m] at which a recorded deflection is zero.

    That is at standstill with the link at its nominal angle.
    """
    nominal = jnp.asarray(p["psi_nominal"])
    rest = static_equilibrium(model, p, nominal, jnp.zeros_like(nominal), prepared)
    return suspension_travel(p, rest.q.theta_LW)
