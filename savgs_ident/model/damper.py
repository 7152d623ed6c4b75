"""Damper: a measured force-velocity table as a monotone C1 curve, scaled as one.

The curve through the table is the monotone piecewise cubic of Fritsch and Carlson (PCHIP). The identified
damping ``c_sd`` [N s/m] scales the whole curve: it is the coefficient of the viscous damper that takes the
same energy out of a sinusoidal strut velocity of 0.15 m/s amplitude,

    c_eq = 1/(pi V) * integral_0^{2 pi} F(V sin tau) sin tau d tau.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.interpolate import PchipInterpolator

from savgs_ident.core.rig import Rig

REFERENCE_VELOCITY = 0.15
"""Amplitude of the strut velocity at which ``c_sd`` is defined [m/s]."""


class DamperCurve(eqx.Module):
    """Force [N] against compression velocity [m/s] for unit damping: times ``c_sd`` it is the damper's force.

    ``knots`` [m/s] of shape (n,); ``coefficients`` of shape (4, n + 1), cubic first, for the n - 1 intervals
    between the knots and the straight continuation below and above them.
    """

    knots: Float[np.ndarray, " n"]
    coefficients: Float[np.ndarray, "4 m"]
    origins: Float[np.ndarray, " m"]

    def __call__(self, velocity: Float[Array, ""]) -> Float[Array, ""]:
        """Force per unit of ``c_sd`` [m/s] at a compression velocity [m/s]; positive resists compression."""
        piece = jnp.sum(velocity >= self.knots)
        cubic, square, slope, constant = jnp.asarray(self.coefficients)[:, piece]
        offset = velocity - jnp.asarray(self.origins)[piece]
        return ((cubic * offset + square) * offset + slope) * offset + constant


def equivalent_damping(velocity: np.ndarray, force: np.ndarray, amplitude: float) -> float:
    """Energy-equivalent viscous coefficient [N s/m] of a table [m/s], [N] at a velocity amplitude [m/s]."""
    curve = PchipInterpolator(velocity, force)
    phase = np.linspace(0.0, 2.0 * np.pi, 4096, endpoint=False)
    return float(2.0 * np.mean(curve(amplitude * np.sin(phase)) * np.sin(phase)) / amplitude)


def damper_curve(rig: Rig) -> DamperCurve:
    """The unit-damping curve of a rig's damper table, continued along its end slopes beyond the table."""
    velocity, force = np.asarray(rig.damper_velocity), np.asarray(rig.damper_force)
    curve = PchipInterpolator(velocity, force)
    slope = curve.derivative()
    ends = [np.array([0.0, 0.0, slope(velocity[i]), force[i]])[:, None] for i in (0, -1)]
    coefficients = np.concatenate([ends[0], curve.c, ends[1]], axis=1)
    origins = np.concatenate([velocity[:1], velocity[:-1], velocity[-1:]])
    scale = equivalent_damping(velocity, force, REFERENCE_VELOCITY)
    return DamperCurve(knots=velocity, coefficients=coefficients / scale, origins=origins)
