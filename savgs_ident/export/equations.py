"""The rig's equations as functions of plain vectors, for every export that carries equations.

    residual(x, y, u, p) = 0        implicit, as the model is written
    rates(x, u, p)       = dx/dt    explicit: the residual solved for the accelerations
    outputs(x, u, p)                what is measured, and loads

    x   z_s, theta_LW, their rates, internal states of the effects
    y   accelerations of both coordinates, rates of the internal states
    u   road height and velocity, link angle and velocity; cam angle and speed where an effect follows the cam
    p   all parameters, so that each can be changed in what was exported

The residual is solved by a fixed number of Newton steps, written out: no other tool has to know how. It is affine in
y but for the friction, whose load depends on the accelerations; from the affine solution two or three steps are
enough.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.rig import Rig
from savgs_ident.effects.registry import build_model, model_parameters
from savgs_ident.model.dynamics import Coordinates, Motion
from savgs_ident.model.effect import AbstractRoadFault, Cam
from savgs_ident.model.inputs import Inputs
from savgs_ident.model.kinematics import suspension_travel
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.small_root import solve_dense
from savgs_ident.model.strut import Link
from savgs_ident.model.tyre import Road

NEWTON_STEPS = 5
"""Newton steps from zero accelerations: twice what motions of the rig need."""


@dataclass(frozen=True)
class Signal:
    """A component of a vector: ``name``, ``unit``, what it is."""

    name: str
    unit: str
    about: str


COORDINATES = (
    Signal("z_s", "m", "height of the sprung mass, up positive"),
    Signal("theta_LW", "rad", "angle of the lower wishbone from the drawing"),
    Signal("z_s_dot", "m/s", "velocity of the sprung mass"),
    Signal("theta_LW_dot", "rad/s", "angular velocity of the lower wishbone"),
)

INPUTS = (
    Signal("road_height", "m", "height of the plate, up positive"),
    Signal("road_velocity", "m/s", "velocity of the plate"),
    Signal("link_angle", "rad", "angle of the single link"),
    Signal("link_velocity", "rad/s", "angular velocity of the single link"),
)

CAM_INPUTS = (
    Signal("cam_angle", "rad", "angle of the cam behind the plate"),
    Signal("cam_speed", "rad/s", "its speed"),
)

OUTPUTS = (
    Signal(
        "sprung_accel", "m/s^2", "acceleration of the sprung mass, as its sensor shows it but for dynamics"
    ),
    Signal("susp_deflection", "m", "suspension deflection from the drawing, bump positive, likewise"),
    Signal("tyre_load", "N", "vertical load of the tyre"),
    Signal("rail_force", "N", "friction of the railway on the sprung mass, up positive"),
    Signal("strut_force", "N", "force with which the strut pushes apart"),
    Signal("link_torque", "N m", "torque of the strut on the link towards greater angles"),
)


@dataclass(frozen=True)
class Equations:
    """A model's equations with the names of everything.

    Attributes:
        model: the model.
        parameters: names of p, in order.
        states: of x.
        inputs: of u.
        outputs: of the results.
    """

    model: QuarterCar
    parameters: tuple[str, ...]
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...] = OUTPUTS

    def residual(
        self, x: Float[Array, " x"], y: Float[Array, " y"], u: Float[Array, " u"], p: Float[Array, " p"]
    ) -> Float[Array, " y"]:
        """Forces [N], moments [N m] and states out of balance."""
        motion, inputs = _motion(x, y), _inputs(u)
        return self.model.residual(self._values(p), motion, x[4:], y[2:], inputs)

    def accelerations(
        self, x: Float[Array, " x"], u: Float[Array, " u"], p: Float[Array, " p"]
    ) -> Float[Array, " y"]:
        """The y [SI] for which the residual vanishes, of x, u and p in SI."""

        def balance(y: Array) -> Array:
            return self.residual(x, y, u, p)

        y = jnp.zeros(x.shape[0] - 2)
        for _ in range(NEWTON_STEPS):
            value, slope = jax.linearize(balance, y)
            columns = [slope(unit) for unit in jnp.unstack(jnp.eye(y.shape[0]))]
            y = y - solve_dense(jnp.stack(columns, axis=1), value)
        return y

    def rates(
        self, x: Float[Array, " x"], u: Float[Array, " u"], p: Float[Array, " p"]
    ) -> Float[Array, " x"]:
        """dx/dt, all in SI."""
        return jnp.concatenate([x[2:4], self.accelerations(x, u, p)])

    def read(self, x: Float[Array, " x"], u: Float[Array, " u"], p: Float[Array, " p"]) -> Float[Array, " o"]:
        """The outputs, all in SI."""
        values, y, inputs = self._values(p), self.accelerations(x, u, p), _inputs(u)
        motion = _motion(x, y)
        loads = self.model.loads(values, motion, x[4:], y[2:], inputs)
        rig = self.model.effective(values)
        travel = suspension_travel(rig, x[1])
        return jnp.stack(
            [
                rig["accel_gain"] * y[0],
                rig["deflection_gain"] * travel,
                loads.vertical,
                loads.rail,
                loads.strut,
                loads.link_torque,
            ]
        )

    def _values(self, p: Array) -> dict[str, Array]:
        return dict(zip(self.parameters, jnp.unstack(p), strict=True))


def _motion(x: Array, y: Array) -> Motion:
    return Motion(Coordinates(x[0], x[1]), Coordinates(x[2], x[3]), Coordinates(y[0], y[1]))


def _inputs(u: Array) -> Inputs:
    cam = Cam(u[4], u[5]) if u.shape[0] > len(INPUTS) else None
    return Inputs(Road(u[0], u[1]), Link(u[2], u[3]), cam)


def equations_of(rig: Rig, effects: tuple[str, ...]) -> Equations:
    """The equations of a rig with the named effects."""
    model = build_model(rig, effects)
    states = tuple(
        Signal(f"state_{place}_{state.name}", state.unit, f"internal state: {state.name}")
        for place, state in enumerate(model.states)
    )
    follows = any(isinstance(effect, AbstractRoadFault) for effect in model.effects)
    inputs = (*INPUTS, *CAM_INPUTS) if follows else INPUTS
    return Equations(model, tuple(model_parameters(rig, effects)), (*COORDINATES, *states), inputs)
