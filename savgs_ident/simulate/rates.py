"""The residual solved for what time integration asks: accelerations and rates of internal states.

They are the root of r(q, qd, qdd, s, sd, input) = 0 in (qdd, sd): piecewise affine but for the damper, because
the rail's friction depends on its load and the load on the accelerations.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.model.dynamics import Coordinates, Motion
from savgs_ident.model.inputs import Inputs
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.section import SectionCurves
from savgs_ident.model.small_root import find_root
from savgs_ident.model.values import Values

ACCELERATION_SCALE = (1.0, 3.0)
"""Typical accelerations of z_s [m/s^2] and theta_LW [rad/s^2]."""

STATE_TIME = 1e-2
"""Time [s] in which an internal state typically changes by its scale."""


class Rates(NamedTuple):
    """Accelerations [m/s^2, rad/s^2], and rates of the internal states (s,) [unit of each per second]."""

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
    near: Float[Array, " y"] | None = None,
) -> Rates:
    """Accelerations and rates that make the residual vanish; NaN where there are none; all in SI.

    ``curves`` of the same parameters serve as in :meth:`QuarterCar.residual`; ``near`` (2 + s,) are accelerations
    and rates of a moment ago, from where they are found sooner. Differentiable in everything, exactly, by the
    implicit function theorem.
    """

    def residual(y: Array) -> Array:
        motion = Motion(q, qd, Coordinates(y[0], y[1]))
        return model.residual(p, motion, s, y[2:], inputs, curves)

    rates = [state.scale / STATE_TIME for state in model.states]
    start = jnp.zeros(2 + len(rates)) if near is None else near
    y = find_root(residual, start, jnp.asarray([*ACCELERATION_SCALE, *rates]))
    return Rates(Coordinates(y[0], y[1]), y[2:])
