"""Tyre: a radial spring and damper that can lift off, pressing on a plate.

The contact point H lies on the plate, on the wheel's own axis of symmetry: with a the roll of the upright
plus the static tilt of the wheel, H = W + s (sin a, -cos a). The radial force k_t c + c_t dc/dt with
c = r_free - s >= 0 pushes along that axis; a plate without friction answers with the vertical load
F_tz = radial / cos a, so that the power of F_tz at H is exactly that of the radial force.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.model.dynamics import Motion, Swing
from savgs_ident.model.kinematics import Point, Values


class Road(NamedTuple):
    """The plate under the tyre: height [m] and velocity [m/s], up positive."""

    height: Float[Array, ""]
    velocity: Float[Array, ""]


class Contact(NamedTuple):
    """State of the contact.

    ``place`` [m] is H in the frame of the sprung mass and ``place_slope`` [m/rad] that of the upright's
    material point at H; ``lateral_velocity`` [m/s] that point's outward velocity; ``compression`` [m] and
    ``compression_rate`` [m/s] radial; ``cos_tilt`` the cosine of the wheel's tilt.
    """

    place: Point
    place_slope: Point
    lateral_velocity: Float[Array, ""]
    compression: Float[Array, ""]
    compression_rate: Float[Array, ""]
    cos_tilt: Float[Array, ""]


def contact(p: Values, swing_: Swing, motion: Motion, road: Road) -> Contact:
    """Where and how the tyre meets the plate."""

    def axis_length(height: Array, roll: Array) -> Array:
        return height / jnp.cos(roll + p["tilt"])

    omega = motion.qd.theta_LW
    height = motion.q.z_s + swing_.pose.W[1] - road.height
    height_rate = motion.qd.z_s + swing_.slope.W[1] * omega - road.velocity
    roll, roll_slope = swing_.pose.roll_K, swing_.slope.roll_K
    length, length_rate = jax.jvp(axis_length, (height, roll), (height_rate, roll_slope * omega))
    tilt = roll + p["tilt"]
    reach = length * jnp.stack([jnp.sin(tilt), -jnp.cos(tilt)])
    place_slope = swing_.slope.W + roll_slope * jnp.stack([-reach[1], reach[0]])
    return Contact(
        place=swing_.pose.W + reach,
        place_slope=place_slope,
        lateral_velocity=place_slope[0] * omega,
        compression=p["r_free"] - length,
        compression_rate=-length_rate,
        cos_tilt=jnp.cos(tilt),
    )


def radial_force(p: Values, touch: Contact, extra: Float[Array, ""]) -> Float[Array, ""]:
    """Radial force [N], never pulling, ``extra`` [N] being what effects add."""
    pressed = p["k_t"] * touch.compression + p["c_t"] * touch.compression_rate + extra
    return jnp.where(touch.compression > 0.0, jnp.maximum(pressed, 0.0), 0.0)
