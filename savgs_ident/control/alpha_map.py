"""From link angle to the equivalent actuator and back: what a controller needs of alpha.

The controller asks for a velocity of the equivalent actuator and knows its position; the rig has a link. With the
wishbone at rest, alpha is a smooth function of the link angle, and its integral from the nominal angle is z_lin:

    thetadot_SL = zdot_lin / alpha(theta_SL),        z_lin = integral of alpha.

A polynomial of degree four leaves 0.2 % of alpha's magnitude; the paper's parabola leaves 2 %.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.polynomial import Polynomial

from savgs_ident.control.linear_equivalent import equivalents
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values

DEGREE = 4
"""Degree of the polynomial that stands for alpha."""

RANGE = (np.radians(10.0), np.radians(170.0))
"""Link angles [rad] over which it is fitted: nearer to the ends alpha vanishes."""


class AlphaMap(eqx.Module):
    """alpha as a polynomial of the angle from ``nominal`` [rad]; ``coefficients`` (n,) [m/rad^(1 + power)]."""

    nominal: Float[Array, ""]
    coefficients: Float[Array, " n"]

    def alpha(self, angle: Float[Array, ""]) -> Float[Array, ""]:
        """alpha [m/rad] at a link angle [rad]."""
        return self._sum(angle - self.nominal, self.coefficients)

    def position(self, angle: Float[Array, ""]) -> Float[Array, ""]:
        """z_lin [m] at a link angle [rad]: 0 at the nominal one, falling with the angle."""
        powers = jnp.arange(1.0, self.coefficients.shape[0] + 1.0)
        turned = angle - self.nominal
        return turned * self._sum(turned, self.coefficients / powers)

    def _sum(self, turned: Array, coefficients: Array) -> Array:
        total = jnp.zeros_like(turned)
        for coefficient in reversed(jnp.unstack(coefficients)):
            total = total * turned + coefficient
        return total


def alpha_map(model: QuarterCar, p: Values) -> AlphaMap:
    """The map of a rig, with its wishbone at rest under the nominal load."""
    nominal = float(p["psi_nominal"])
    angles = np.linspace(*RANGE, 161)
    found = np.asarray(equivalents(model, p, jnp.zeros(angles.size), jnp.asarray(angles)).alpha)
    fitted = Polynomial.fit(angles - nominal, found, DEGREE).convert()
    return AlphaMap(jnp.asarray(nominal), jnp.asarray(fitted.coef))
