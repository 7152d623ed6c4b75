"""Exact linearisation of any plant at a state.

The implicit residual r(q, qd, qdd, s, sd, u; p) = 0 is differentiated with respect to all its arguments at once, and
solved for the accelerations and the rates of the internal states:

    [dqdd; dsd] = -(dr/d[qdd, sd])^-1 (dr/dq dq + dr/dqd dqd + dr/ds ds + dr/du du).

    at = nominal_rest(plant, p)
    space = linearise_plant(plant, p, at, plant_signals(plant)).space      # python-control, named signals
    space["susp_deflection", "road_height_rate"]

The equations take the value and the rate of every input. Where the rate counts (the velocity of a road under a
tyre's damper), the rate is the input of the linear model and the value one of its states; where it does not (a drive
force), the value is the input itself.

This holds for small departures. Where a friction sticks, the plant has its bristle as a spring.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import control
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.small_root import Root
from savgs_ident.core.values import Values
from savgs_ident.effects.base import InputSignal
from savgs_ident.plants.at_rest import Rest, find_rest, standing
from savgs_ident.plants.base import AbstractPlant, Input, Motion, Output
from savgs_ident.simulate.transient import solve_rates


class OperatingPoint(NamedTuple):
    """A state of a plant [SI].

    Coordinates (n scalars), their rates, internal states (s,), and value and rate of each input. ``root`` says how a
    state of rest was found.
    """

    q: Any
    qd: Any
    s: Float[Array, " s"]
    signals: tuple[InputSignal, ...]
    root: Root


ReadOutputs = Callable[[Any, Values, Motion, Array, Array, Any], Float[Array, " o"]]
"""The outputs (o,) [SI] of a plant with parameters, in a motion, with internal states, their rates, and inputs."""


@dataclass(frozen=True)
class LinearSignals:
    """What a linear model of a plant calls its states, and what its outputs are.

    Attributes:
        states: name and unit of the n coordinates, then of their rates.
        internal: what precedes the place of an internal state in its name.
        nominal: the plant's nominal state, in words.
        outputs: the outputs.
        read: computes them.
    """

    states: tuple[tuple[str, str], ...]
    internal: str
    nominal: str
    outputs: tuple[Output, ...]
    read: ReadOutputs


def plant_signals(plant: AbstractPlant) -> LinearSignals:
    """The signals that follow from what a plant declares: its coordinates, readings and outputs."""
    coordinates = [(each.name, each.unit) for each in plant.coordinates]
    rates = [(f"{each.name}_dot", f"{each.unit}/s") for each in plant.coordinates]
    readings = [Output(each.name, each.unit, each.about) for each in plant.channels]
    nominal = " and ".join(f"the {each.about} at its nominal value" for each in plant.inputs if each.rest)
    outputs = (*readings, *plant.outputs)
    return LinearSignals(
        (*coordinates, *rates), "state_", nominal or "its inputs at zero", outputs, _read_declared
    )


def _read_declared(plant: AbstractPlant, p: Values, motion: Motion, s: Array, sd: Array, u: Any) -> Array:
    loads = plant.loads(p, motion, s, sd, u)
    return jnp.stack([*plant.read(p, motion, s, sd, u), *plant.read_outputs(loads)])


def rate_name(each: Input) -> str:
    """What the rate of an input is called in exports."""
    return each.rate_name or f"{each.name}_rate"


def rest_or_origin(plant: AbstractPlant, p: Values, u: Any) -> Rest:
    """Where the plant stands still under constant inputs ``u``; look at the status of its root.

    What stands wherever it is put (a carriage without a position loop) rests at the origin.
    """
    rest = find_rest(plant, p, u)
    origin = plant.coordinate_type(*(jnp.zeros(()) for _ in plant.coordinates))
    states = jnp.zeros_like(rest.s)
    balance = plant.residual(p, standing(plant, origin), states, states, u)
    # Without a restoring force the search divides by zero, although nothing is out of balance.
    stands = ~(rest.root.step_left <= rest.root.precision) & jnp.all(balance == 0.0)
    there = Rest(origin, states, jax.tree.map(jnp.zeros_like, rest.root))
    return jax.tree.map(lambda searched, zero: jnp.where(stands, zero, searched), rest, there)


def nominal_rest(plant: AbstractPlant, p: Values) -> OperatingPoint:
    """The plant at rest under its nominal inputs; look at the status of its root."""
    return rest_under(plant, p, [p[each.rest] if each.rest else 0.0 for each in plant.inputs])


def rest_under(plant: AbstractPlant, p: Values, inputs: Sequence[Float[Array, ""] | float]) -> OperatingPoint:
    """The plant at rest under constant inputs (m values) [SI]; look at the status of its root."""
    # As arrays: a Python number would be compiled into the program, one for every value.
    return _rest_under(plant, p, tuple(jnp.asarray(each, jnp.float64) for each in inputs))


@eqx.filter_jit
def _rest_under(plant: AbstractPlant, p: Values, inputs: tuple[Array, ...]) -> OperatingPoint:
    signals = tuple(InputSignal(each, jnp.zeros_like(each)) for each in inputs)
    q, s, root = rest_or_origin(plant, p, plant.drive(signals))
    return OperatingPoint(q, standing(plant, q).qd, s, signals, root)


class Slopes(NamedTuple):
    """Derivatives of the residual (n + s,) and of the outputs (o,) along all of x = (q, qd, s), y = (qdd, sd), u.

    ``u`` are value and rate of each input in turn, (2 m,). ``root`` are the accelerations and the rates of internal
    states there.
    """

    residual_x: Array
    residual_y: Array
    residual_u: Array
    output_x: Array
    output_y: Array
    output_u: Array
    root: Root


def _evaluated(
    plant: AbstractPlant, p: Values, read: ReadOutputs, x: Array, y: Array, u: Array
) -> Float[Array, " k"]:
    """The residual, then the outputs."""
    n, pack = len(plant.coordinates), plant.coordinate_type
    motion = Motion(*(pack(*jnp.unstack(part)) for part in (x[:n], x[n : 2 * n], y[:n])))
    signals = tuple(InputSignal(u[place], u[place + 1]) for place in range(0, u.shape[0], 2))
    s, sd, inputs = x[2 * n :], y[n:], plant.drive(signals)
    residual = plant.residual(p, motion, s, sd, inputs)
    return jnp.concatenate([residual, read(plant, p, motion, s, sd, inputs)])


@eqx.filter_jit
def slopes(plant: AbstractPlant, p: Values, at: OperatingPoint, read: ReadOutputs) -> Slopes:
    """All derivatives at a state; look at the status of the root that its accelerations are."""
    rates = solve_rates(plant, p, at.q, at.qd, at.s, plant.drive(at.signals))
    x = jnp.concatenate([jnp.stack([*at.q, *at.qd]), at.s])
    y = jnp.concatenate([jnp.stack([*rates.qdd]), rates.sd])
    u = jnp.stack([part for signal in at.signals for part in signal])
    by_x, by_y, by_u = jax.jacfwd(partial(_evaluated, plant, p, read), argnums=(0, 1, 2))(x, y, u)
    rows = y.shape[0]
    return Slopes(by_x[:rows], by_y[:rows], by_u[:rows], by_x[rows:], by_y[rows:], by_u[rows:], rates.root)


@eqx.filter_jit
def _rates_that_count(plant: AbstractPlant, p: Values, at: OperatingPoint, read: ReadOutputs) -> Array:
    """Which inputs' rates the equations and the outputs contain, (m,), whatever their factors are."""
    x = jnp.concatenate([jnp.stack([*at.q, *at.qd]), at.s])
    y = jnp.zeros(len(plant.coordinates) + len(plant.states))
    u = jnp.stack([part for signal in at.signals for part in signal])
    # What contains a rate that is not a number is none either, even where its factor is zero.
    lost = [
        _evaluated(plant, p, read, x, y, u.at[2 * place + 1].set(jnp.nan))
        for place in range(len(plant.inputs))
    ]
    return jnp.stack([jnp.any(jnp.isnan(each)) for each in lost])


class Linearised(NamedTuple):
    """A linear model with named signals, and the units of all of them by name."""

    space: control.StateSpace
    units: dict[str, str]


def linearise_plant(
    plant: AbstractPlant, p: Values, at: OperatingPoint, signals: LinearSignals
) -> Linearised:
    """The plant near a state.

    States are the coordinates and their rates, the internal states of the effects, and the values of the inputs whose
    rates count. Raises :class:`InputError` at a state where the plant finds no accelerations.
    """
    found: Slopes = jax.tree.map(np.asarray, slopes(plant, p, at, signals.read))
    by_rate = np.asarray(_rates_that_count(plant, p, at, signals.read))
    refused = InputError(
        "the plant cannot be linearised there: it finds no accelerations",
        remedy="choose a state within the travel of its coordinates, and masses above zero",
    )
    if not found.root.status().ok:
        raise refused
    try:
        matrices = _matrices(len(plant.coordinates), found, by_rate)
    except np.linalg.LinAlgError:
        raise refused from None
    labels = _labels(plant, by_rate, signals)
    names = {kind: list(units) for kind, units in labels.items()}
    units = {name: unit for each in labels.values() for name, unit in each.items()}
    return Linearised(control.ss(*matrices, **names, name="exact"), units)


def _labels(
    plant: AbstractPlant, by_rate: NDArray[np.bool_], signals: LinearSignals
) -> dict[str, dict[str, str]]:
    """Names and units of states, inputs and outputs, in order."""
    internal = {
        f"{signals.internal}{place}_{state.name}": state.unit for place, state in enumerate(plant.states)
    }
    held, inputs = {}, {}
    for each, rate in zip(plant.inputs, by_rate, strict=True):
        if rate:
            held[each.name] = each.unit
        inputs[rate_name(each) if rate else each.name] = f"{each.unit}/s" if rate else each.unit
    return {
        "states": dict(signals.states) | internal | held,
        "inputs": inputs,
        "outputs": {each.name: each.unit for each in signals.outputs},
    }


def _matrices(n: int, found: Slopes, by_rate: NDArray[np.bool_]) -> tuple[NDArray[np.float64], ...]:
    """A, B, C and D of slopes of a plant with n coordinates; ``by_rate`` (m,) says which inputs enter as rates."""
    solve = partial(np.linalg.solve, -found.residual_y)
    y_x, y_u = solve(found.residual_x), solve(found.residual_u)
    k, m = found.residual_x.shape[1], by_rate.size
    # Of u = (value, rate) of each input: the columns by which they enter, and those of the values that are states.
    enters, held = 2 * np.arange(m) + by_rate, 2 * np.flatnonzero(by_rate)
    a, b = np.zeros((k + held.size, k + held.size)), np.zeros((k + held.size, m))
    a[:n, n : 2 * n] = np.eye(n)
    a[n:k, :k], a[n:k, k:], b[n:k] = y_x, y_u[:, held], y_u[:, enters]
    b[k + np.arange(held.size), held // 2] = 1.0
    through = found.output_u + found.output_y @ y_u
    c = np.hstack([found.output_x + found.output_y @ y_x, through[:, held]])
    return a, b, np.asarray(c), np.asarray(through[:, enters])
