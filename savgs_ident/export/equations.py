"""The equations of a plant as functions of plain vectors, for every export that carries equations.

    residual(x, y, u, p) = 0        implicit, as the model is written
    rates(x, u, p)       = dx/dt    explicit: the residual solved for the accelerations
    outputs(x, u, p)                what is measured, and loads

    x   coordinates, their rates, internal states of the effects
    y   accelerations of the coordinates, rates of the internal states
    u   value and rate of every input; angle and speed of the periodic test where an effect follows them
    p   all parameters, so that each can be changed in the export

The residual is solved by a fixed number of unrolled Newton steps, so that other tools need no solver. It is
affine in y except for the friction, whose load depends on the accelerations; from the affine solution two or
three steps suffice.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.small_root import solve_dense
from savgs_ident.effects.base import AbstractInputLaw, Fundamental, InputSignal
from savgs_ident.plants.base import AbstractPlant, Motion

NEWTON_STEPS = 5
"""Newton steps from zero accelerations: twice as many as motions of the rig need."""


@dataclass(frozen=True)
class Signal:
    """A component of a vector: ``name``, ``unit`` and description."""

    name: str
    unit: str
    about: str


FUNDAMENTAL_INPUTS = (
    Signal("cam_angle", "rad", "angle of the periodic test, 0 where the first input's first order peaks"),
    Signal("cam_speed", "rad/s", "its speed"),
)


@dataclass(frozen=True)
class Equations:
    """A model's equations with the names of all components.

    Attributes:
        model: the model.
        parameters: names of p, in order.
        states: of x.
        inputs: of u.
        outputs: of the results.
    """

    model: AbstractPlant
    parameters: tuple[str, ...]
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]

    def residual(
        self, x: Float[Array, " x"], y: Float[Array, " y"], u: Float[Array, " u"], p: Float[Array, " p"]
    ) -> Float[Array, " y"]:
        """Forces [N], moments [N m] and states out of balance."""
        return self.model.residual(self._values(p), *self._at(x, y), self._inputs(u))

    def accelerations(
        self, x: Float[Array, " x"], u: Float[Array, " u"], p: Float[Array, " p"]
    ) -> Float[Array, " y"]:
        """The y [SI] for which the residual vanishes, of x, u and p in SI."""

        def balance(y: Array) -> Array:
            return self.residual(x, y, u, p)

        y = jnp.zeros(x.shape[0] - len(self.model.coordinates))
        for _ in range(NEWTON_STEPS):
            value, slope = jax.linearize(balance, y)
            columns = [slope(unit) for unit in jnp.unstack(jnp.eye(y.shape[0]))]
            y = y - solve_dense(jnp.stack(columns, axis=1), value)
        return y

    def rates(
        self, x: Float[Array, " x"], u: Float[Array, " u"], p: Float[Array, " p"]
    ) -> Float[Array, " x"]:
        """dx/dt, all in SI."""
        n = len(self.model.coordinates)
        return jnp.concatenate([x[n : 2 * n], self.accelerations(x, u, p)])

    def read(self, x: Float[Array, " x"], u: Float[Array, " u"], p: Float[Array, " p"]) -> Float[Array, " o"]:
        """The outputs, all in SI: what the sensors show but for their dynamics, then what the plant offers beside."""
        values, inputs = self._values(p), self._inputs(u)
        at = self._at(x, self.accelerations(x, u, p))
        loads = self.model.loads(values, *at, inputs)
        return jnp.stack([*self.model.read(values, *at, inputs), *self.model.read_outputs(loads)])

    def _at(self, x: Array, y: Array) -> tuple[Motion, Array, Array]:
        """The motion, the internal states and their rates."""
        n, pack = len(self.model.coordinates), self.model.coordinate_type
        parts = (x[:n], x[n : 2 * n], y[:n])
        return Motion(*(pack(*jnp.unstack(part)) for part in parts)), x[2 * n :], y[n:]

    def _inputs(self, u: Array) -> Any:
        own = 2 * len(self.model.inputs)
        signals = tuple(InputSignal(u[i], u[i + 1]) for i in range(0, own, 2))
        fundamental = Fundamental(u[own], u[own + 1]) if u.shape[0] > own else None
        return self.model.drive(signals, fundamental)

    def _values(self, p: Array) -> dict[str, Array]:
        return dict(zip(self.parameters, jnp.unstack(p), strict=True))


def build_equations(model: AbstractPlant, parameters: Iterable[str]) -> Equations:
    """The equations of a plant with its effects; ``parameters`` are the names of all numbers that it takes."""
    coordinates = [Signal(each.name, each.unit, each.about) for each in model.coordinates]
    rates = [
        Signal(f"{each.name}_dot", f"{each.unit}/s", f"rate of: {each.about}") for each in model.coordinates
    ]
    states = [
        Signal(f"state_{place}_{state.name}", state.unit, f"internal state: {state.name}")
        for place, state in enumerate(model.states)
    ]
    inputs: list[Signal] = []
    for each in model.inputs:
        inputs.append(Signal(each.name, each.unit, each.details or each.about))
        rate = each.rate_name or f"{each.name}_rate"
        inputs.append(Signal(rate, f"{each.unit}/s", f"rate of: {each.details or each.about}"))
    if any(isinstance(effect.law, AbstractInputLaw) for effect in model.effects):
        inputs += FUNDAMENTAL_INPUTS
    readings = [
        Signal(each.name, each.unit, f"{each.about}, as its sensor shows it but for dynamics")
        for each in model.channels
    ]
    beside = [Signal(each.name, each.unit, each.about) for each in model.outputs]
    return Equations(
        model,
        tuple(parameters),
        (*coordinates, *rates, *states),
        tuple(inputs),
        (*readings, *beside),
    )
