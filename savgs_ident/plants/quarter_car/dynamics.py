"""Equations of motion by virtual power, railway reactions included, and what of them depends on one angle alone.

Coordinates are q = (z_s, theta_LW, y_s, phi): height of the sprung mass, angle of the lower wishbone, and
the two that the railway holds at zero, lateral position and roll about the carriages' midpoint. Every force f
at a point r contributes f . dr/dq_k to the generalised force of q_k, inertia forces -m a included. The first
two sums vanish along a motion; the last two are what the railway has to hold:

    F_Ny = -sum Q_y,        M_Nx = -sum Q_phi,

so that the reactions come out of the same equations, not of a separate derivation. The inertia forces are affine in
(zdd_s + g, thetadd, thetad^2), so a 4 x 3 matrix says all about them.

This matrix, like the pose of the linkage, depends on theta_LW alone. A :class:`Section` holds both at one angle;
:func:`section` computes it in closed form. Where many points share one parameter set, :class:`SectionCurves` does the
same from polynomials through the closed form at Chebyshev nodes, to about 1e-12, at a tenth of the cost and still
differentiable in every hardpoint.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.polynomial import chebyshev

from savgs_ident.core.values import Values
from savgs_ident.plants.base import Motion
from savgs_ident.plants.quarter_car.kinematics import Linkage, Pair, Point, linkage, linkage_slope

GeneralisedForce = Float[Array, "4"]
"""Along (z_s [N], theta_LW [N m], y_s [N], phi [N m])."""


class Coordinates(NamedTuple):
    """Height of the sprung mass [m] and angle of the lower wishbone [rad], or a time derivative of them."""

    z_s: Float[Array, ""]
    theta_LW: Float[Array, ""]


class Swing(NamedTuple):
    """The linkage's pose and its first and second derivatives in theta_LW."""

    pose: Linkage
    slope: Linkage
    curvature: Linkage


def swing(p: Values, theta_LW: Float[Array, ""]) -> Swing:
    """Pose, d/dtheta and d^2/dtheta^2 of the linkage at ``theta_LW`` [rad]."""
    at, along = (theta_LW,), (jnp.ones_like(theta_LW),)
    slope, curvature = jax.jvp(lambda theta: linkage_slope(p, theta), at, along)
    return Swing(linkage(p, theta_LW), slope, curvature)


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


TRAVEL = 0.35
"""Half the range of theta_LW that curves cover [rad]: some 13 cm of wheel travel either way."""

_NODES = 18
_POINTS = chebyshev.chebpts1(_NODES)
_TO_COEFFICIENTS = np.linalg.inv(chebyshev.chebvander(_POINTS, _NODES - 1))
_DERIVATIVE = chebyshev.chebval(_POINTS, chebyshev.chebder(_TO_COEFFICIENTS)).T
"""From values at the nodes to those of the derivative of the polynomial through them."""
_SLOPES = np.zeros((_NODES, _NODES))
_SLOPES[:, :-1] = chebyshev.chebder(np.eye(_NODES)).T
"""The slopes of the polynomials T_k, in terms of the polynomials: T_k' = sum over j of _SLOPES[k, j] T_j."""


class Section(NamedTuple):
    """The rig at one angle of the lower wishbone.

    Wheel centre (``W_y``, ``W_z``) and strut eye (``E_y``, ``E_z``) [m], cosine and sine of the upright's roll,
    slopes of places and roll in theta_LW, and ``inertia`` (4, 3): generalised forces of inertia and weight along
    (z_s, theta_LW, y_s, phi) per unit of zdd_s + g, of thetadd and of thetad^2.
    """

    W_y: Float[Array, ""]
    W_z: Float[Array, ""]
    E_y: Float[Array, ""]
    E_z: Float[Array, ""]
    cos_roll: Float[Array, ""]
    sin_roll: Float[Array, ""]
    W_y_slope: Float[Array, ""]
    W_z_slope: Float[Array, ""]
    E_y_slope: Float[Array, ""]
    E_z_slope: Float[Array, ""]
    roll_slope: Float[Array, ""]
    inertia: Float[Array, "4 3"]


def section(p: Values, theta_LW: Float[Array, ""]) -> Section:
    """The section at ``theta_LW`` [rad] in closed form; NaN where the linkage cannot be assembled."""
    return _section_of(p, swing(p, theta_LW))


def _section_of(p: Values, swing_: Swing) -> Section:
    zero = jnp.zeros_like(swing_.pose.roll_K)
    one = jnp.ones_like(zero)
    weightless = dict(p) | {"g": zero}

    def inertia(lift: Array, alpha: Array, omega: Array) -> Array:
        motion = Motion(Coordinates(zero, zero), Coordinates(zero, omega), Coordinates(lift, alpha))
        return inertia_and_weight(weightless, swing_, motion)

    columns = (inertia(one, zero, zero), inertia(zero, one, zero), inertia(zero, zero, one))
    pose, slope = swing_.pose, swing_.slope
    places = (*pose.W, *pose.E, jnp.cos(pose.roll_K), jnp.sin(pose.roll_K))
    slopes = (*slope.W, *slope.E, slope.roll_K)
    return Section._make((*places, *slopes, jnp.stack(columns, axis=1)))


@jax.custom_jvp
def _terms(ratio: Float[Array, ""]) -> Float[Array, " n"]:
    """T_0 to T_(n-1) at ``ratio`` [1]."""
    double, terms = 2.0 * ratio, [jnp.ones_like(ratio), ratio]
    while len(terms) < _NODES:
        terms.append(double * terms[-1] - terms[-2])
    return jnp.stack(terms)


# The recurrence, differentiated, is a tenth of a solver's program.
@_terms.defjvp
def _terms_and_change(at: tuple[Array], change: tuple[Array]) -> tuple[Array, Array]:
    terms = _terms(*at)
    return terms, jnp.asarray(_SLOPES) @ terms * change[0]


class SectionCurves(eqx.Module):
    """Chebyshev coefficients of all entries of a section over ``theta_LW / TRAVEL``, (23, n) [SI]."""

    coefficients: Float[Array, "entries n"]

    def __call__(self, theta_LW: Float[Array, ""]) -> Section:
        """The section at ``theta_LW`` [rad], good to about 1e-12 within :data:`TRAVEL`."""
        entries = self.coefficients @ _terms(theta_LW / TRAVEL)
        return Section._make((*entries[:11], entries[11:].reshape(4, 3)))


_SHAPING = (
    *(f"{point}_{axis}" for point in ("A", "B", "C", "D", "E", "W", "cg_L", "cg_U", "cg_K") for axis in "yz"),
    *("m_s", "m_u", "m_L", "m_U", "J_L", "J_U", "J_K", "z_tb", "g"),
)
"""The parameters that curves depend on."""


def section_curves(p: Values) -> SectionCurves:
    """The curves of a parameter set.

    Pose and slope are evaluated in closed form; the curvature at the nodes is that of the polynomial through the
    slopes, which is exact to rounding and much less to compile.
    """
    # Without the parameters of effects: with them it would be compiled anew for each model.
    return _section_curves({name: p[name] for name in _SHAPING})


# Compiled by itself: it is traced once for the solver and for its derivatives.
@eqx.filter_jit
def _section_curves(p: Values) -> SectionCurves:
    pose, slope = jax.vmap(lambda theta: (linkage(p, theta), linkage_slope(p, theta)))(TRAVEL * _POINTS)
    curvature = jax.tree.map(lambda values: jnp.tensordot(_DERIVATIVE / TRAVEL, values, axes=1), slope)
    at_nodes = jax.vmap(lambda swing_: _section_of(p, swing_))(Swing(pose, slope, curvature))
    entries = jnp.stack([*at_nodes[:11], *at_nodes.inertia.reshape(_NODES, 12).T])
    return SectionCurves(entries @ _TO_COEFFICIENTS.T)
