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
from scipy.interpolate import PchipInterpolator, PPoly

from savgs_ident.core.errors import InputError
from savgs_ident.plants.quarter_car.rig import Rig

REFERENCE_VELOCITY = 0.15
"""Amplitude of the strut velocity at which ``c_sd`` is defined [m/s]."""


class DamperCurve(eqx.Module):
    """Force [N] against compression velocity [m/s] for unit damping: times ``c_sd`` it is the damper's force.

    ``knots`` [m/s] of shape (n,); ``coefficients`` of shape (4, n + 1), cubic first, in velocities counted
    from ``origins`` [m/s] of shape (n + 1,), for the n - 1 intervals between the knots and the straight
    continuation below and above them.
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
    """Energy-equivalent viscous coefficient [N s/m] of a table [m/s], [N] at a velocity amplitude [m/s].

    The table may be narrower than the amplitude: beyond it the curve is the one of :func:`damper_curve`.
    Both columns of the table are (n,).
    """
    curve = _monotone_curve(velocity, force)
    corners = np.clip(curve.x / amplitude, -1.0, 1.0)
    turns = np.arcsin(np.unique(np.concatenate([[-1.0], corners, [1.0]])))
    nodes, weights = np.polynomial.legendre.leggauss(16)
    half, middle = np.diff(turns) / 2.0, (turns[1:] + turns[:-1]) / 2.0
    sine = np.sin(middle[:, None] + half[:, None] * nodes)
    # The way back is the way there: twice the half cycle.
    energy = 2.0 * np.sum(half[:, None] * weights * curve(amplitude * sine) * sine)
    return float(energy / (np.pi * amplitude))


def _monotone_curve(velocity: np.ndarray, force: np.ndarray) -> PPoly:
    """PCHIP through the table with a straight piece before and behind it, which hold on and on."""
    table = PchipInterpolator(velocity, force)
    first, last = table.derivative()(velocity[[0, -1]])
    before = np.array([0.0, 0.0, first, force[0] - first])
    behind = np.array([0.0, 0.0, last, force[-1]])
    breaks = np.concatenate([velocity[:1] - 1.0, velocity, velocity[-1:] + 1.0])
    return PPoly(np.column_stack([before, table.c, behind]), breaks)


def damper_curve(rig: Rig) -> DamperCurve:
    """The unit-damping curve of a rig's damper table, continued along its end slopes beyond the table.

    Raises :class:`InputError` for a table that takes no energy at the reference velocity.
    """
    velocity, force = np.asarray(rig.damper_velocity), np.asarray(rig.damper_force)
    scale = equivalent_damping(velocity, force, REFERENCE_VELOCITY)
    if scale <= 0.0:
        raise InputError(
            f"damper table takes no energy at {REFERENCE_VELOCITY} m/s",
            source=rig.name,
            remedy="give a force there that resists the motion",
        )
    curve = _monotone_curve(velocity, force)
    return DamperCurve(knots=velocity, coefficients=curve.c / scale, origins=curve.x[:-1])
