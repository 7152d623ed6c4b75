"""The linear equivalent of the suspension: equations (4)-(8) of the paper, by differentiation of the kinematics.

At the wheel, a strut that pushes with F_SD and shortens by R = -dl_SD/dl_s per suspension deflection acts as a spring
and a damper between the masses, and a rotation of the single link as a displacement z_lin of their upper end at
constant strut length (:class:`Equivalent`):

    k_eq = d(R F_SD)/dl_s,      c_eq = R^2 c_sd,      dz_lin/dtheta_SL = alpha = (dl_SD/dtheta_SL) / R.

k_eq includes the load: dR/dl_s times the static push is 5 % of it here. With l_s positive in bump, alpha is negative
between 0 and 180 deg.

Equation (8) is the state space of two masses, the equivalent spring and damper between them, the tyre below, and a
hypothetical linear actuator in series with spring and damper, whose velocity is the input
(:func:`quarter_car_space`):

    m_s dzdot_s/dt = F,     m_u dzdot_u/dt = k_t l_t + c_t dl_t/dt - F,
    F = k_eq (l_s - z_lin) + c_eq d(l_s - z_lin)/dt

    states   zdot_s, zdot_u, l_s, l_t, z_lin      inputs  road_velocity, lin_velocity

The paper lumps the unsprung mass at the wheel centre and gives the damper one coefficient. At small motions the rig
differs in both: the wishbones and the upright rotate (the mass matrix [m_s, 0; 0, m_u] becomes full), and the damper
has its slope at rest, not the coefficient that dissipates the same energy at 0.15 m/s. :func:`with_damper_at_rest`
and :func:`with_distributed_masses` undo one simplification after the other.

A controller commands a velocity of the equivalent actuator and needs its position; the rig has a link. With the
wishbone at rest, alpha is a smooth function of the link angle (:class:`AlphaMap`), and its integral from the nominal
angle is z_lin:

    thetadot_SL = zdot_lin / alpha(theta_SL),        z_lin = integral of alpha.

A polynomial of degree four leaves an error of 0.2 % of the magnitude of alpha; the parabola of the paper leaves 2 %.
"""

from typing import NamedTuple

import control
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from savgs_ident.control.linearisation import RIG_SIGNALS
from savgs_ident.core.small_root import Root
from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.kinematics import installation_ratio, strut_length, suspension_travel
from savgs_ident.plants.quarter_car.plant import QuarterCar, static_equilibrium
from savgs_ident.simulate.linearisation import nominal_rest, slopes

Scalar = Float[Array, ""]


class Equivalent(NamedTuple):
    """The strut as a spring and damper at the wheel, in one state or along (n,) states.

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
def resting_angles(
    model: QuarterCar, p: Values, theta_SL: Float[Array, " n"]
) -> tuple[Float[Array, " n"], Root]:
    """Angle of the lower wishbone [rad] at which the rig rests, for link angles [rad], (n,), and how it was found."""
    still = jnp.zeros(())

    def at(angle: Float[Array, ""]) -> tuple[Float[Array, ""], Root]:
        rest = static_equilibrium(model, p, angle, still)
        return rest.q.theta_LW, rest.root

    found: tuple[Array, Root] = jax.lax.map(at, theta_SL)
    return found


Matrix = NDArray[np.float64]
STATES = ("sprung_velocity", "unsprung_velocity", "susp_deflection", "tyre_deflection", "lin_position")
"""[m/s], [m/s], [m], [m], [m]."""
INPUTS = ("road_velocity", "lin_velocity")
"""[m/s] both."""
OUTPUTS = ("sprung_accel", "susp_deflection", "tyre_deflection", "lin_position")
"""[m/s^2], [m], [m], [m]."""
UNITS = dict(zip(STATES, ("m/s", "m/s", "m", "m", "m"), strict=True)) | {
    "road_velocity": "m/s",
    "lin_velocity": "m/s",
    "sprung_accel": "m/s^2",
}
"""Units of all these by name."""


class TwoMasses(NamedTuple):
    """The numbers of eq. (8): ``mass`` [kg], (2, 2), of sprung and unsprung velocity; the rest SI."""

    mass: Matrix
    k_eq: float
    c_eq: float
    k_t: float
    c_t: float


def lumped_mass(m_s: float, m_u: float) -> Matrix:
    """The mass matrix [kg], (2, 2), of eq. (8): the unsprung mass as a point at the wheel centre."""
    return np.diag([m_s, m_u])


def quarter_car_space(rig: TwoMasses) -> control.StateSpace:
    """Equation (8) with named signals; see :data:`STATES`, :data:`INPUTS` and :data:`OUTPUTS`."""
    # Forces on the sprung and the unsprung mass, by state and by input.
    strut = np.array([-rig.c_eq, rig.c_eq, rig.k_eq, 0.0, -rig.k_eq])
    tyre = np.array([0.0, -rig.c_t, 0.0, rig.k_t, 0.0])
    by_state = np.linalg.solve(rig.mass, np.stack([strut, tyre - strut]))
    by_input = np.linalg.solve(rig.mass, np.array([[0.0, -rig.c_eq], [rig.c_t, rig.c_eq]]))
    a, b = np.zeros((5, 5)), np.zeros((5, 2))
    a[:2], b[:2] = by_state, by_input
    a[2, :2] = -1.0, 1.0
    a[3, 1], b[3, 0] = -1.0, 1.0
    b[4, 1] = 1.0
    c, d = np.zeros((4, 5)), np.zeros((4, 2))
    c[0], d[0] = a[0], b[0]
    c[1, 2] = c[2, 3] = c[3, 4] = 1.0
    return control.ss(a, b, c, d, states=STATES, inputs=INPUTS, outputs=OUTPUTS, name="linear_equivalent")


def nominal_equivalent(model: QuarterCar, p: Values) -> Equivalent:
    """k_eq, c_eq, alpha and R in the nominal state of the drawing."""
    at = equivalents(model, p, jnp.zeros(1), jnp.asarray(p["psi_nominal"])[None])
    return Equivalent(*(part[0] for part in at))


def paper_masses(model: QuarterCar, p: Values) -> TwoMasses:
    """Equation (8) as it is printed."""
    rig, at = model.effective(p), nominal_equivalent(model, p)
    mass = lumped_mass(float(rig["m_s"]), float(rig["m_u"]))
    return TwoMasses(mass, float(at.k_eq), float(at.c_eq), float(rig["k_t"]), float(rig["c_t"]))


def with_damper_at_rest(model: QuarterCar, p: Values, masses: TwoMasses) -> TwoMasses:
    """The same with the damper's slope at rest in place of its energy-equivalent coefficient."""
    slope = float(jax.grad(model.damper)(jnp.zeros(())))
    return masses._replace(c_eq=masses.c_eq * slope)


def with_distributed_masses(model: QuarterCar, p: Values, masses: TwoMasses) -> TwoMasses:
    """The same with wishbones and upright as rigid bodies: the mass matrix couples the two velocities."""
    bare, rig = QuarterCar(model.damper), model.effective(p)
    at = nominal_rest(bare, rig)
    inertia = -np.asarray(slopes(bare, rig, at, RIG_SIGNALS.read).residual_y)
    travel = float(jax.grad(suspension_travel, argnums=1)(rig, at.q.theta_LW))
    turn: NDArray[np.float64] = np.array([[1.0, 0.0], [-1.0 / travel, 1.0 / travel]])
    return masses._replace(mass=turn.T @ inertia @ turn)


DEGREE = 4
"""Degree of the polynomial of alpha."""
RANGE = (np.radians(10.0), np.radians(170.0))
"""Link angles [rad] over which it is fitted; nearer to 0 and 180 deg alpha vanishes."""


class AlphaMap(eqx.Module):
    """alpha as a polynomial of the angle from ``nominal`` [rad]; ``coefficients`` (n,) [m/rad^(1 + power)]."""

    nominal: Float[Array, ""]
    coefficients: Float[Array, " n"]

    def alpha(self, angle: Float[Array, ""]) -> Float[Array, ""]:
        """alpha [m/rad] at a link angle [rad]."""
        return self._sum(angle - self.nominal, self.coefficients)

    def position(self, angle: Float[Array, ""]) -> Float[Array, ""]:
        """z_lin [m] at a link angle [rad]: 0 at the nominal one, decreasing with the angle."""
        powers = jnp.arange(1.0, self.coefficients.shape[0] + 1.0)
        turned = angle - self.nominal
        return turned * self._sum(turned, self.coefficients / powers)

    def _sum(self, turned: Array, coefficients: Array) -> Array:
        total = jnp.zeros_like(turned)
        for coefficient in reversed(jnp.unstack(coefficients)):
            total = total * turned + coefficient
        return total


def alpha_map(model: QuarterCar, p: Values) -> AlphaMap:
    """The map of a rig, with its wishbone at rest under the nominal load."""
    nominal = float(p["psi_nominal"])
    angles = np.linspace(*RANGE, 161)
    found = np.asarray(equivalents(model, p, jnp.zeros(angles.size), jnp.asarray(angles)).alpha)
    fitted = Polynomial.fit(angles - nominal, found, DEGREE).convert()
    return AlphaMap(jnp.asarray(nominal), jnp.asarray(fitted.coef))
