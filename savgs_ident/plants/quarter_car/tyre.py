"""Tyre: a radial spring and damper that can lift off, pressing on a plate.

The contact point H lies on the plate, on the wheel's own axis of symmetry: with a the roll of the upright
plus the static tilt of the wheel, H = W + s (sin a, -cos a). The radial force k_t c + c_t dc/dt with
c = r_free - s >= 0 pushes along that axis; a plate without friction answers with the vertical load
F_tz = radial / cos a, so that the power of F_tz at H is exactly that of the radial force.
"""

from collections.abc import Mapping
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.values import Values
from savgs_ident.effects.base import Fundamental
from savgs_ident.plants.base import Motion
from savgs_ident.plants.quarter_car.dynamics import Section
from savgs_ident.plants.quarter_car.kinematics import Pair
from savgs_ident.plants.quarter_car.strut import Link


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
    tilt, tilt_rate = section.roll + p["tilt"], section.roll_slope * omega
    cosine, sine = jnp.cos(tilt), jnp.sin(tilt)
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
