"""The residual solved for what time integration asks: accelerations and rates of internal states.

The first two rows of r(q, qd, qdd, s, sd, input) = 0 are balances of force that know nothing of sd, and the
others read sd - rate = 0. So two unknowns are left to solve for, the accelerations: piecewise affine, because
the rail's friction depends on its load and the load on the accelerations. The rates follow from one more
evaluation, at sd = 0.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.model.dynamics import Coordinates, Motion
from savgs_ident.model.quarter_car import Inputs, QuarterCar
from savgs_ident.model.section import SectionCurves
from savgs_ident.model.small_root import find_root
from savgs_ident.model.values import Values

ACCELERATION_SCALE = (1.0, 3.0)
"""Typical accelerations of z_s [m/s^2] and theta_LW [rad/s^2]."""


class Rates(NamedTuple):
    """Accelerations, and rates of the internal states (s,)."""

    qdd: Coordinates
    sd: Float[Array, " s"]


def solve_rates(
    model: QuarterCar,
    p: Values,
    q: Coordinates,
    qd: Coordinates,
    s: Float[Array, " s"],
    inputs: Inputs,
    curves: SectionCurves | None = None,
) -> Rates:
    """Accelerations and rates that make the residual vanish; NaN where there are none.

    ``curves`` of the same parameters serve as in :meth:`QuarterCar.residual`. Differentiable in everything,
    exactly, by the implicit function theorem.
    """
    still = jnp.zeros_like(s)

    def residual(accelerations: Array) -> Array:
        motion = Motion(q, qd, Coordinates(accelerations[0], accelerations[1]))
        return model.residual(p, motion, s, still, inputs, curves)

    scale = jnp.asarray(ACCELERATION_SCALE)
    accelerations = find_root(lambda y: residual(y)[:2], jnp.zeros(2), scale)
    return Rates(Coordinates(accelerations[0], accelerations[1]), -residual(accelerations)[2:])
