"""The forces on the mechanism: the strut, which is spring and damper, and the tyre on its plate.

The strut acts between the eye on the lower wishbone and the crank pin of the single link. Its damper is a measured
force-velocity table as a monotone C1 curve, scaled as one: the curve through the table is the monotone piecewise
cubic of Fritsch and Carlson (PCHIP). The identified damping ``c_sd`` [N s/m] scales the whole curve: it is the
coefficient of the viscous damper that takes the same energy out of a sinusoidal strut velocity of 0.15 m/s
amplitude,

    c_eq = 1/(pi V) * integral_0^{2 pi} F(V sin tau) sin tau d tau.

The tyre is a radial spring and damper that can lift off, pressing on a plate. The contact point H lies on the plate,
on the wheel's own axis of symmetry: with a the roll of the upright plus the static tilt of the wheel,
H = W + s (sin a, -cos a). The radial force k_t c + c_t dc/dt with c = r_free - s >= 0 pushes along that axis; a plate
without friction answers with the vertical load F_tz = radial / cos a, so that the power of F_tz at H is exactly that
of the radial force.
"""

from collections.abc import Mapping
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.interpolate import PchipInterpolator, PPoly

from savgs_ident.core.errors import InputError
from savgs_ident.core.values import Values
from savgs_ident.effects.base import Fundamental
from savgs_ident.plants.base import Motion
from savgs_ident.plants.quarter_car.dynamics import Section
from savgs_ident.plants.quarter_car.kinematics import Pair, crank_pin
from savgs_ident.plants.quarter_car.rig import Rig


class Link(NamedTuple):
    """Imposed motion of the single link: angle [rad] and velocity [rad/s]."""

    angle: Float[Array, ""]
    velocity: Float[Array, ""]


class Strut(NamedTuple):
    """Length l_SD [m], its rate [m/s], and its slopes in theta_LW and in the link angle [m/rad]."""

    length: Float[Array, ""]
    rate: Float[Array, ""]
    slope: Float[Array, ""]
    link_slope: Float[Array, ""]


class Standing(NamedTuple):
    """The strut of the drawing: its push [N] and the torque with which it turns the link to greater angles [N m]."""

    push: Float[Array, ""]
    torque: Float[Array, ""]


def strut_at_rest(p: Values) -> Standing:
    """Loads of the strut in the nominal state."""
    angle = p["theta_0"] + p["psi_nominal"]
    pin_y, pin_z = crank_pin(p, p["psi_nominal"])
    span_y, span_z = pin_y - p["E_y"], pin_z - p["E_z"]
    length = jnp.sqrt(span_y**2 + span_z**2)
    push = p["k_sd"] * (p["l_free"] - length)
    return Standing(push, push * p["l_SL"] * (span_z * jnp.cos(angle) - span_y * jnp.sin(angle)) / length)


def strut(p: Values, section: Section, omega: Float[Array, ""], link: Link) -> Strut:
    """The strut at a section whose angle moves at ``omega`` [rad/s]."""
    pin_y, pin_z = crank_pin(p, link.angle)
    angle = p["theta_0"] + link.angle
    span_y, span_z = pin_y - section.E_y, pin_z - section.E_z
    length = jnp.sqrt(span_y**2 + span_z**2)
    slope = -(span_y * section.E_y_slope + span_z * section.E_z_slope) / length
    link_slope = p["l_SL"] * (span_z * jnp.cos(angle) - span_y * jnp.sin(angle)) / length
    return Strut(length, slope * omega + link_slope * link.velocity, slope, link_slope)


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


class Road(NamedTuple):
    """The plate under the tyre: height [m] and velocity [m/s], up positive."""

    height: Float[Array, ""]
    velocity: Float[Array, ""]


class Contact(NamedTuple):
    """State of the contact.

    ``place`` [m] is H in the frame of the sprung mass; ``place_slope`` [m/rad] the slope in theta_LW of the
    upright's material point at H and ``lateral_velocity`` [m/s] that point's outward velocity; ``compression``
    [m] and ``compression_rate`` [m/s] radial; ``cos_tilt`` the cosine of the wheel's tilt.
    """

    place: Pair
    place_slope: Pair
    lateral_velocity: Float[Array, ""]
    compression: Float[Array, ""]
    compression_rate: Float[Array, ""]
    cos_tilt: Float[Array, ""]


def contact(p: Values, section: Section, motion: Motion, road: Road) -> Contact:
    """Where and how the tyre meets the plate."""
    omega = motion.qd.theta_LW
    tilt_rate, set_cosine, set_sine = section.roll_slope * omega, jnp.cos(p["tilt"]), jnp.sin(p["tilt"])
    # The sum of two angles: the compiler would take cosine and sine anew wherever they enter.
    cosine = section.cos_roll * set_cosine - section.sin_roll * set_sine
    sine = section.sin_roll * set_cosine + section.cos_roll * set_sine
    height = motion.q.z_s + section.W_z - road.height
    height_rate = motion.qd.z_s + section.W_z_slope * omega - road.velocity
    length = height / cosine
    length_rate = (height_rate + height * tilt_rate * sine / cosine) / cosine
    place_slope = (
        section.W_y_slope + section.roll_slope * height,
        section.W_z_slope + section.roll_slope * length * sine,
    )
    return Contact(
        place=(section.W_y + length * sine, section.W_z - height),
        place_slope=place_slope,
        lateral_velocity=place_slope[0] * omega,
        compression=p["r_free"] - length,
        compression_rate=-length_rate,
        cos_tilt=cosine,
    )


def radial_force(p: Values, touch: Contact, extra: Float[Array, ""]) -> Float[Array, ""]:
    """Radial force [N], never pulling, ``extra`` [N] being what effects add."""
    pressed = p["k_t"] * touch.compression + p["c_t"] * touch.compression_rate + extra
    return jnp.where(touch.compression > 0.0, jnp.maximum(pressed, 0.0), 0.0)


class Inputs(NamedTuple):
    """What drives the rig: road and link; the cam behind the road and what is imposed at ports, if anything."""

    road: Road
    link: Link
    cam: Fundamental | None = None
    imposed: Mapping[str, Array] | None = None
