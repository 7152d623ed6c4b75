"""Equations of motion by virtual power, railway reactions included.

Coordinates are q = (z_s, theta_LW, y_s, phi): height of the sprung mass, angle of the lower wishbone, and
the two that the railway holds at zero, lateral position and roll about the carriages' midpoint. Every force f
at a point r contributes f . dr/dq_k to the generalised force of q_k, inertia forces -m a included. The first
two sums vanish along a motion; the last two are what the railway has to hold:

    F_Ny = -sum Q_y,        M_Nx = -sum Q_phi,

so that the reactions come out of the same equations, not of a separate derivation.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.model.kinematics import Linkage, Pair, Point, linkage
from savgs_ident.model.values import Values

GeneralisedForce = Float[Array, "4"]
"""Along (z_s [N], theta_LW [N m], y_s [N], phi [N m])."""


class Coordinates(NamedTuple):
    """Height of the sprung mass [m] and angle of the lower wishbone [rad], or a time derivative of them."""

    z_s: Float[Array, ""]
    theta_LW: Float[Array, ""]


class Motion(NamedTuple):
    """Instantaneous motion: coordinates and their first and second time derivatives."""

    q: Coordinates
    qd: Coordinates
    qdd: Coordinates


class Swing(NamedTuple):
    """The linkage's pose and its first and second derivatives in theta_LW."""

    pose: Linkage
    slope: Linkage
    curvature: Linkage


def swing(p: Values, theta_LW: Float[Array, ""]) -> Swing:
    """Pose, d/dtheta and d^2/dtheta^2 of the linkage at ``theta_LW`` [rad]."""

    def pose_and_slope(theta: Array) -> tuple[Linkage, Linkage]:
        return jax.jvp(lambda angle: linkage(p, angle), (theta,), (jnp.ones_like(theta),))

    (pose, slope), (_, curvature) = jax.jvp(pose_and_slope, (theta_LW,), (jnp.ones_like(theta_LW),))
    return Swing(pose, slope, curvature)


def point_force(
    p: Values, place: Point | Pair, place_slope: Point | Pair, force: Point | Pair
) -> GeneralisedForce:
    """Generalised force of a force (f_y, f_z) [N] at a point [m] with slope d(place)/d(theta_LW) [m/rad]."""
    along_theta = place_slope[0] * force[0] + place_slope[1] * force[1]
    roll_moment = place[0] * force[1] - (place[1] - p["z_tb"]) * force[0]
    return jnp.stack([force[1], along_theta, force[0], roll_moment])


def _body_force(
    p: Values, swing_: Swing, body: str, mass: Array, inertia: Array, motion: Motion
) -> GeneralisedForce:
    place, place_1, place_2 = (getattr(part, f"cg_{body}") for part in swing_)
    roll_1, roll_2 = (getattr(part, f"roll_{body}") for part in swing_[1:])
    omega, alpha = motion.qd.theta_LW, motion.qdd.theta_LW
    relative = place_1 * alpha + place_2 * omega**2
    inertial = -mass * jnp.stack([relative[0], relative[1] + motion.qdd.z_s + p["g"]])
    torque = -inertia * (roll_1 * alpha + roll_2 * omega**2)
    zero = jnp.zeros_like(torque)
    return point_force(p, place, place_1, inertial) + jnp.stack([zero, torque * roll_1, zero, torque])


def upright_mass(p: Values) -> Float[Array, ""]:
    """Mass of upright, hub and wheel [kg]: the unsprung mass less the wishbones."""
    return p["m_u"] - p["m_L"] - p["m_U"]


def inertia_and_weight(p: Values, swing_: Swing, motion: Motion) -> GeneralisedForce:
    """Generalised force of inertia and gravity of all bodies.

    The sprung mass has its centre of gravity on the rail line, so it adds nothing to the roll moment.
    """
    sprung = -p["m_s"] * (motion.qdd.z_s + p["g"])
    zero = jnp.zeros_like(sprung)
    return (
        jnp.stack([sprung, zero, zero, zero])
        + _body_force(p, swing_, "L", p["m_L"], p["J_L"], motion)
        + _body_force(p, swing_, "U", p["m_U"], p["J_U"], motion)
        + _body_force(p, swing_, "K", upright_mass(p), p["J_K"], motion)
    )


def weight(p: Values) -> Float[Array, ""]:
    """Weight of the rig on the plate [N]."""
    return (p["m_s"] + p["m_u"]) * p["g"]


def carriage_load(p: Values, total: GeneralisedForce) -> Float[Array, ""]:
    """|F_Nt| + |F_Nb| [N] of eq. (2) from the sum of all generalised forces on the rig.

    F_Nt = M_Nx/l_tb + F_Ny/2 and F_Nb = M_Nx/l_tb - F_Ny/2.
    """
    lateral, moment = -total[2], -total[3]
    pair, half = moment / p["l_tb"], lateral / 2.0
    return jnp.abs(pair + half) + jnp.abs(pair - half)
