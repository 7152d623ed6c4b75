"""What is exported: a model with all that is known about it, and its equations as functions of vectors.

Every export takes one :class:`ExportedModel` and a folder, and writes files there. The posterior and the
diagnosis are included as far as a format can hold them. Formats with equations share the values at rest, where a
simulation begins, the record of the signals (names, units, nominal values), and the equations, in JAX
(:class:`Equations`) and as functions of CasADi (:func:`casadi_functions`):

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

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import jax.numpy as jnp
import numpy as np
from casadi import Function
from jaxtyping import Array, Float
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.small_root import Root, jacobian, solve_dense
from savgs_ident.core.values import as_values
from savgs_ident.effects.base import AbstractInputLaw, Fundamental, InputSignal
from savgs_ident.effects.effect import Effect
from savgs_ident.effects.learned import learned_effect
from savgs_ident.effects.learned_functions import functions_at
from savgs_ident.plants.at_rest import nominal_inputs
from savgs_ident.plants.base import AbstractPlant, Motion
from savgs_ident.plants.model import Model
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.simulate.linearisation import rate_name, rest_or_origin
from savgs_ident.symbolic.translate import to_casadi

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
            value, matrix = jacobian(balance, y)
            y = y - solve_dense(matrix, value)
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
        inputs.append(Signal(rate_name(each), f"{each.unit}/s", f"rate of: {each.details or each.about}"))
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


@dataclass(frozen=True)
class ExportedModel:
    """A model to be exported, of any plant.

    Attributes:
        model: the model, as drawn or identified, a diagnosed effect included.
        samples: draws of a posterior by parameter, each (n,), SI; empty without a posterior.
        diagnosis: the document of a diagnosis; empty without one.
    """

    model: Model
    samples: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    diagnosis: Mapping[str, object] = field(default_factory=dict)

    @property
    def table(self) -> ParameterTable:
        """All parameters of the model."""
        return self.model.table

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects in the model."""
        return self.model.effects

    @property
    def plant(self) -> AbstractPlant:
        """The plant with its effects."""
        return self.model.build()

    @property
    def quarter_car(self) -> RigModel | None:
        """The model, if it is one of the paper's rig, of which some formats say more; else None."""
        return self.model if isinstance(self.model, RigModel) else None

    @property
    def equations(self) -> Equations:
        """The model's equations."""
        return build_equations(self.plant, self.table)

    @property
    def covariance(self) -> tuple[tuple[str, ...], NDArray[np.float64]]:
        """Names and covariance [products of their units], (n, n), of the estimated parameters.

        Empty for a drawing.
        """
        carried = self.model.provenance.get("covariance")
        if not isinstance(carried, Mapping):
            return (), np.zeros((0, 0))
        return tuple(carried["names"]), np.array(carried["matrix"], dtype=np.float64)


def learned_effects(model: Model) -> dict[str, Effect]:
    """The corrections by name that a diagnosis learns at the ports of the model's plant."""
    found = (learned_effect(port) for port in model.build().scaled_ports if functions_at(port))
    return {effect.name: effect for effect in found}


def with_effects(model: Model, names: Iterable[str]) -> Model:
    """The model with more effects: of its catalogue, or learned at its ports.

    Raises :class:`InputError` for another name.
    """
    learned = learned_effects(model)
    for name in names:
        model = model + (name if name in model.catalogue else learned.get(name, name))
    return model


def resting_state(model: ExportedModel) -> list[float]:
    """x [SI] at rest in the nominal state: the initial state of a simulation.

    Raises :class:`InputError` if the rig finds no rest there.
    """
    p = as_values(model.table.as_dict())
    plant = model.plant
    rest = rest_or_origin(plant, p, nominal_inputs(plant, p))
    check_rest(rest.root, model)
    return [*map(float, rest.q), *(0.0 for _ in rest.q), *map(float, rest.s)]


def check_rest(found: Root, model: ExportedModel) -> None:
    """Raise :class:`InputError` unless the rest in the nominal state was ``found``."""
    if not found.status().ok:
        nominal = [
            f"{each.about} {model.table[each.rest].value:.4g} {each.unit}"
            for each in model.plant.inputs
            if each.rest
        ]
        state = f"its nominal state ({', '.join(nominal)})" if nominal else "its nominal state"
        raise InputError(
            f"the plant finds no rest in {state}, from which what is exported begins",
            remedy="mend what it is held by: its springs, masses or geometry; what nothing holds is moved for ever "
            "by a constant force, as the offset of a drive: give `export` the model without that effect",
        )


def resting_inputs(model: ExportedModel) -> list[float]:
    """u [SI] at rest: zero except for inputs that rest at a value of their own."""
    equations, table = model.equations, model.table
    rest = {each.name: table[each.rest].value for each in equations.model.inputs if each.rest}
    return [rest.get(signal.name, 0.0) for signal in equations.inputs]


def signals_record(model: ExportedModel) -> dict[str, object]:
    """Names and units of x, u, the outputs and p in their order, with values at rest and of the parameters.

    Raises :class:`InputError` if the rig finds no rest.
    """
    equations, table = model.equations, model.table
    return {
        "x": _at_rest(equations.states, resting_state(model)),
        "u": _at_rest(equations.inputs, resting_inputs(model)),
        "outputs": [_signal_record(signal) for signal in equations.outputs],
        "p": [
            {"name": name, "unit": table[name].unit, "about": table[name].about, "value": table[name].value}
            for name in equations.parameters
        ],
    }


def _signal_record(signal: Signal) -> dict[str, object]:
    return {"name": signal.name, "unit": signal.unit, "about": signal.about}


def _at_rest(signals: Sequence[Signal], values: Sequence[float]) -> list[dict[str, object]]:
    return [
        _signal_record(signal) | {"at_rest": value} for signal, value in zip(signals, values, strict=True)
    ]


def casadi_functions(model: ExportedModel) -> dict[str, Function]:
    """``rates`` (x, u, p) to dx/dt, ``outputs`` (x, u, p), ``residual`` (x, y, u, p); columns in the order of names.

    Raises :class:`TranslationError` for an effect whose law has no translation.
    """
    equations = model.equations
    x, u = np.zeros(len(equations.states)), np.zeros(len(equations.inputs))
    given = {"x": x, "u": u, "p": np.array(model.table.values_of(equations.parameters))}
    implicit = {"x": x, "y": np.zeros(x.size - len(equations.model.coordinates))} | given
    translations: tuple[tuple[str, Callable[..., Any], dict[str, np.ndarray], str], ...] = (
        ("rates", equations.rates, given, "dx"),
        ("outputs", equations.read, given, "outputs"),
        ("residual", equations.residual, implicit, "residual"),
    )
    return {
        name: to_casadi(name, function, inputs, [result]) for name, function, inputs, result in translations
    }
