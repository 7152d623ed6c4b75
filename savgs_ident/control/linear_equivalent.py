"""The linear equivalent of the suspension: equations (4)-(7) of the paper, by differentiation of the kinematics.

Seen at the wheel, a strut that pushes with F_SD and shortens by R = -dl_SD/dl_s per suspension deflection is a
spring and a damper between the masses,

    k_eq = d(R F_SD)/dl_s,      c_eq = R^2 c_sd,

and a turn of the single link is a displacement z_lin of their upper end that leaves the strut's length as it is:

    dz_lin/dtheta_SL = alpha = (dl_SD/dtheta_SL) / R.

    F = k_eq (l_s - z_lin) + c_eq d(l_s - z_lin)/dt.

With l_s positive in bump, alpha is negative between 0 and 180 deg. k_eq holds the load: dR/dl_s times the static
push belongs to it, 5 % here.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.model.equilibrium import static_equilibrium
from savgs_ident.model.kinematics import installation_ratio, strut_length, suspension_travel
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values

Scalar = Float[Array, ""]


class Equivalent(NamedTuple):
    """What the strut is at the wheel, at one state or along (n,) states.

    ``k_eq`` [N/m], ``c_eq`` [N s/m], ``alpha`` [m/rad], ``ratio`` the installation ratio R [1].
    """

    k_eq: Array
    c_eq: Array
    alpha: Array
    ratio: Array


def equivalent(p: Values, theta_LW: Scalar, theta_SL: Scalar) -> Equivalent:
    """The equivalent at a wishbone and a link angle [rad]; c_eq is that of the identified damping c_sd."""

    def at_wheel(angle: Scalar) -> Scalar:
        push = p["k_sd"] * (p["l_free"] - strut_length(p, angle, theta_SL))
        return installation_ratio(p, angle, theta_SL) * push

    ratio = installation_ratio(p, theta_LW, theta_SL)
    stiffness = jax.grad(at_wheel)(theta_LW) / jax.grad(suspension_travel, argnums=1)(p, theta_LW)
    alpha = jax.grad(strut_length, argnums=2)(p, theta_LW, theta_SL) / ratio
    return Equivalent(stiffness, p["c_sd"] * ratio**2, alpha, ratio)


@eqx.filter_jit
def equivalents(
    model: QuarterCar, p: Values, theta_LW: Float[Array, " n"], theta_SL: Float[Array, " n"]
) -> Equivalent:
    """The same along (n,) pairs of angles [rad], of the rig with the model's changes made."""
    p = model.effective(p)
    return jax.vmap(lambda wishbone, link: equivalent(p, wishbone, link))(theta_LW, theta_SL)


@eqx.filter_jit
def resting_angles(model: QuarterCar, p: Values, theta_SL: Float[Array, " n"]) -> Float[Array, " n"]:
    """Angle of the lower wishbone [rad] at which the rig rests, for link angles [rad], (n,)."""
    still = jnp.zeros(())
    return jax.lax.map(lambda angle: static_equilibrium(model, p, angle, still).q.theta_LW, theta_SL)
