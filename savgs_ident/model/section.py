"""Everything of the rig that depends on the lower wishbone's angle alone.

The pose of the linkage and the inertia of the unsprung bodies depend on one variable, theta_LW. A
:class:`Section` holds them at one angle; :func:`section` computes it in closed form. Where many points share
one parameter set, :class:`SectionCurves` does the same from polynomials through the closed form at Chebyshev
nodes, to about 1e-12, at a tenth of the cost and still differentiable in every hardpoint.

The inertia forces are affine in (zdd_s + g, thetadd, thetad^2), so a 4 x 3 matrix says all about them.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.polynomial import chebyshev

from savgs_ident.model.dynamics import Coordinates, Motion, Swing, inertia_and_weight, swing
from savgs_ident.model.kinematics import Linkage, linkage
from savgs_ident.model.values import Values

TRAVEL = 0.35
"""Half the range of theta_LW that curves cover [rad]: some 13 cm of wheel travel either way."""

_NODES = 18
_POINTS = chebyshev.chebpts1(_NODES)
_TO_COEFFICIENTS = np.linalg.inv(chebyshev.chebvander(_POINTS, _NODES - 1))
_DERIVATIVE = chebyshev.chebval(_POINTS, chebyshev.chebder(_TO_COEFFICIENTS)).T
"""From values at the nodes to those of the derivative of the polynomial through them."""


class Section(NamedTuple):
    """The rig at one angle of the lower wishbone.

    Wheel centre (``W_y``, ``W_z``) and strut eye (``E_y``, ``E_z``) [m], roll of the upright [rad], their
    slopes in theta_LW, and ``inertia`` (4, 3): generalised forces of inertia and weight along
    (z_s, theta_LW, y_s, phi) per unit of zdd_s + g, of thetadd and of thetad^2.
    """

    W_y: Float[Array, ""]
    W_z: Float[Array, ""]
    E_y: Float[Array, ""]
    E_z: Float[Array, ""]
    roll: Float[Array, ""]
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
    places = (*pose.W, *pose.E, pose.roll_K, *slope.W, *slope.E, slope.roll_K)
    return Section._make((*places, jnp.stack(columns, axis=1)))


class SectionCurves(eqx.Module):
    """Chebyshev coefficients of all entries of a section over ``theta_LW / TRAVEL``, (22, n) [SI]."""

    coefficients: Float[Array, "entries n"]

    def __call__(self, theta_LW: Float[Array, ""]) -> Section:
        """The section at ``theta_LW`` [rad], good to about 1e-12 within :data:`TRAVEL`."""
        ratio = theta_LW / TRAVEL
        terms = [jnp.ones_like(ratio), ratio]
        while len(terms) < _NODES:
            terms.append(2.0 * ratio * terms[-1] - terms[-2])
        entries = self.coefficients @ jnp.stack(terms)
        return Section._make((*entries[:10], entries[10:].reshape(4, 3)))


# Compiled by itself: it is traced once for the solver and for its derivatives.
@eqx.filter_jit
def section_curves(p: Values) -> SectionCurves:
    """The curves of a parameter set.

    Pose and slope are evaluated in closed form; the curvature at the nodes is that of the polynomial through the
    slopes, which is exact to rounding and much less to compile.
    """

    def pose_and_slope(theta: Array) -> tuple[Linkage, Linkage]:
        return jax.jvp(lambda angle: linkage(p, angle), (theta,), (jnp.ones_like(theta),))

    pose, slope = jax.vmap(pose_and_slope)(jnp.asarray(TRAVEL * _POINTS))
    curvature = jax.tree.map(lambda values: jnp.tensordot(_DERIVATIVE / TRAVEL, values, axes=1), slope)
    at_nodes = jax.vmap(lambda swing_: _section_of(p, swing_))(Swing(pose, slope, curvature))
    entries = jnp.stack([*at_nodes[:10], *at_nodes.inertia.reshape(_NODES, 12).T])
    return SectionCurves(entries @ _TO_COEFFICIENTS.T)
