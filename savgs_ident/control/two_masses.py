"""The numbers of equation (8) for a rig, as the paper takes them and with two of its simplifications undone.

The paper lumps the unsprung mass at the wheel centre and gives the damper one coefficient. At small motions the rig
differs in both: the wishbones and the upright turn, and the damper has its slope at rest, not the coefficient that
takes the same energy at 0.15 m/s. Undoing one after the other shows what each of them costs.
"""

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.control.linear_equivalent import Equivalent, equivalents
from savgs_ident.control.linearisation import resting, slopes
from savgs_ident.control.quarter_car_space import TwoMasses, lumped
from savgs_ident.model.kinematics import suspension_travel
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values


def nominal_equivalent(model: QuarterCar, p: Values) -> Equivalent:
    """k_eq, c_eq, alpha and R in the nominal state of the drawing."""
    at = equivalents(model, p, jnp.zeros(1), jnp.asarray(p["psi_nominal"])[None])
    return Equivalent(*(part[0] for part in at))


def paper_masses(model: QuarterCar, p: Values) -> TwoMasses:
    """Equation (8) as it is printed."""
    rig, at = model.effective(p), nominal_equivalent(model, p)
    mass = lumped(float(rig["m_s"]), float(rig["m_u"]))
    return TwoMasses(mass, float(at.k_eq), float(at.c_eq), float(rig["k_t"]), float(rig["c_t"]))


def with_damper_at_rest(model: QuarterCar, p: Values, masses: TwoMasses) -> TwoMasses:
    """The same with the damper's slope at rest for its energy-equivalent coefficient."""
    slope = float(jax.grad(model.damper)(jnp.zeros(())))
    return masses._replace(c_eq=masses.c_eq * slope)


def with_distributed_masses(model: QuarterCar, p: Values, masses: TwoMasses) -> TwoMasses:
    """The same with wishbones and upright as the bodies they are: the mass matrix couples the two velocities."""
    bare, rig = QuarterCar(model.damper), model.effective(p)
    at = resting(bare, rig, p["psi_nominal"])
    inertia = -np.asarray(slopes(bare, rig, at).residual_y)
    travel = float(jax.grad(suspension_travel, argnums=1)(rig, at.q.theta_LW))
    turn: NDArray[np.float64] = np.array([[1.0, 0.0], [-1.0 / travel, 1.0 / travel]])
    return masses._replace(mass=turn.T @ inertia @ turn)
