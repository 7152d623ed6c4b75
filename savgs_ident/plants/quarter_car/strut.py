"""Strut: spring and damper between the eye on the lower wishbone and the crank pin of the single link."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.dynamics import Section
from savgs_ident.plants.quarter_car.kinematics import crank_pin


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
