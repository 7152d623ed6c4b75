"""Exact linearisation of the rig at any state: the behaviour of the nonlinear model for small departures from it.

The implicit residual r(q, qd, qdd, s, sd, input) = 0 is differentiated with respect to all its arguments at once, and
solved for the accelerations and the rates of the internal states:

    [dqdd; dsd] = -(dr/d[qdd, sd])^-1 (dr/dq dq + dr/dqd dqd + dr/ds ds + dr/dinput dinput).

    at = resting(model, p, link_angle=np.pi / 2)
    space = linearise(model, p, at)                 # python-control, named signals
    space["sprung_accel", "road_velocity"]

At a state where a friction sticks, this is the rig with its bristle as a spring. The linearisation of a motion is
:mod:`savgs_ident.control.describing_function`.
"""

from functools import partial
from typing import NamedTuple

import control
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from savgs_ident.core.errors import InputError
from savgs_ident.core.values import Values
from savgs_ident.plants.base import Motion
from savgs_ident.plants.quarter_car.dynamics import Coordinates
from savgs_ident.plants.quarter_car.forces import Inputs, Link, Road
from savgs_ident.plants.quarter_car.kinematics import suspension_travel
from savgs_ident.plants.quarter_car.plant import QuarterCar, static_equilibrium
from savgs_ident.simulate.transient import solve_rates

INPUTS = ("road_velocity", "link_velocity")
"""[m/s], [rad/s]."""
OUTPUTS = (
    "sprung_accel", "susp_deflection", "tyre_deflection", "tyre_load", "link_torque", "link_angle",
)  # fmt: skip
"""[m/s^2], [m], [m], [N], torque of the strut on the link towards greater angles [N m], [rad]."""
_RIGID = ("sprung_position", "wishbone_angle", "sprung_velocity", "wishbone_velocity")


class OperatingPoint(NamedTuple):
    """A state: coordinates [m, rad], their rates, internal states (s,), road [m, m/s], link [rad, rad/s]."""

    q: Coordinates
    qd: Coordinates
    s: Float[Array, " s"]
    road: Road
    link: Link


def resting(model: QuarterCar, p: Values, link_angle: Float[Array, ""] | float) -> OperatingPoint:
    """The rig at rest with the link at an angle [rad]."""
    # As an array: a Python number would be compiled into the program, one for every angle.
    return _resting(model, p, jnp.asarray(link_angle, jnp.float64))


def nominal_rest(model: QuarterCar, p: Values) -> OperatingPoint:
    """The rig at rest with the link at its nominal angle."""
    return resting(model, p, p["psi_nominal"])


@eqx.filter_jit
def _resting(model: QuarterCar, p: Values, angle: Float[Array, ""]) -> OperatingPoint:
    zero = jnp.zeros_like(angle)
    rest = static_equilibrium(model, p, angle, zero)
    return OperatingPoint(rest.q, Coordinates(zero, zero), rest.s, Road(zero, zero), Link(angle, zero))


class Slopes(NamedTuple):
    """Derivatives of the residual (2 + s,) and of the outputs (6,) along all of x = (q, qd, s), y = (qdd, sd), u.

    ``u`` are the heights, angles and velocities imposed: road height and velocity, link angle and velocity.
    """

    residual_x: Array
    residual_y: Array
    residual_u: Array
    output_x: Array
    output_y: Array
    output_u: Array


def _outputs(model: QuarterCar, p: Values, motion: Motion, s: Array, sd: Array, inputs: Inputs) -> Array:
    loads = model.loads(p, motion, s, sd, inputs)
    rig = model.effective(p)
    travel = suspension_travel(rig, motion.q.theta_LW)
    return jnp.stack(
        [
            motion.qdd.z_s,
            travel,
            inputs.road.height - motion.q.z_s - travel,
            loads.vertical,
            loads.link_torque,
            inputs.link.angle,
        ]
    )


@eqx.filter_jit
def slopes(model: QuarterCar, p: Values, at: OperatingPoint) -> Slopes:
    """All derivatives at a state; NaN where the model is not defined."""
    count = len(model.states)
    rates = solve_rates(model, p, at.q, at.qd, at.s, Inputs(at.road, at.link))
    x = jnp.concatenate([jnp.stack([*at.q, *at.qd]), at.s])
    y = jnp.concatenate([jnp.stack([*rates.qdd]), rates.sd])
    u = jnp.stack([*at.road, *at.link])

    def everything(x: Array, y: Array, u: Array) -> Array:
        motion = Motion(Coordinates(x[0], x[1]), Coordinates(x[2], x[3]), Coordinates(y[0], y[1]))
        inputs = Inputs(Road(u[0], u[1]), Link(u[2], u[3]))
        residual = model.residual(p, motion, x[4:], y[2:], inputs)
        return jnp.concatenate([residual, _outputs(model, p, motion, x[4:], y[2:], inputs)])

    by_x, by_y, by_u = jax.jacfwd(everything, argnums=(0, 1, 2))(x, y, u)
    rows = 2 + count
    return Slopes(by_x[:rows], by_y[:rows], by_u[:rows], by_x[rows:], by_y[rows:], by_u[rows:])


def linearise(model: QuarterCar, p: Values, at: OperatingPoint) -> control.StateSpace:
    """The rig near a state, with named signals: :data:`INPUTS`, :data:`OUTPUTS`.

    States are the coordinates and their rates, the internal states of the effects, the road's height [m] and the
    link's angle [rad]. Raises :class:`InputError` at a state outside the travel of the rig, where there is no
    linearisation.
    """
    found: Slopes = jax.tree.map(np.asarray, slopes(model, p, at))
    if not all(np.isfinite(part).all() for part in found):
        raise InputError(
            "the rig cannot be linearised there: it finds no accelerations",
            remedy="choose a state within the travel of the suspension",
        )
    n = found.residual_x.shape[1]
    solve = partial(np.linalg.solve, -found.residual_y)
    y_x, y_u = solve(found.residual_x), solve(found.residual_u)
    # Heights and angles are integrals of the inputs, so they are states too.
    a, b = np.zeros((n + 2, n + 2)), np.zeros((n + 2, 2))
    a[0, 2] = a[1, 3] = 1.0
    a[2:n, :n], a[2:n, n:], b[2:n] = y_x, y_u[:, ::2], y_u[:, 1::2]
    b[n, 0] = b[n + 1, 1] = 1.0
    through = found.output_u + found.output_y @ y_u
    c = np.hstack([found.output_x + found.output_y @ y_x, through[:, ::2]])
    internal = [f"{place}_{state.name}" for place, state in enumerate(model.states)]
    return control.ss(
        a,
        b,
        c,
        through[:, 1::2],
        states=[*_RIGID, *internal, "road_height", "link_angle"],
        inputs=INPUTS,
        outputs=OUTPUTS,
        name="exact",
    )
