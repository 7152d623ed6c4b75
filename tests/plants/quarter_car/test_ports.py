"""Ports of the rig: where a force acts, with what power, what gives way there, and how effects add up."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import (
    AbstractForceLaw,
    Family,
    InternalState,
    Port,
    PortKind,
    PortSignals,
    Role,
)
from savgs_ident.effects.effect import Effect, effect_at
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.plants.quarter_car.dynamics import SectionCurves, section_curves
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.ports import PORTS, STRUT, TYRE_LATERAL

from ...in_one_test import over
from .instants import NOMINAL, as_values, draw_instants, inputs_of, motion_of
from .series import SERIES_PORTS, yielding

FORCE = 7.0
FORCE_PORTS = [port for port in PORTS if port.kind is PortKind.FORCE]


class _Free(AbstractForceLaw):
    """A force as its second state says; the rates of its states show what the port shows."""

    name: ClassVar[str] = "free"
    family: ClassVar[Family] = Family.LEARNED
    roles: ClassVar[tuple[Role, ...]] = ()

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        return {}

    def states(self, port: Port) -> tuple[InternalState, ...]:
        return (InternalState("velocity", "m/s", 1.0), InternalState("force", "N", 1.0))

    def force(self, v: Values, signals: PortSignals, state: Array) -> Array:
        return state[1]

    def rate(self, v: Values, signals: PortSignals, state: Array) -> Array:
        return jnp.stack([signals.velocity, 10.0 * state[1]])


def _probe(port: Port, name: str) -> Effect:
    return effect_at(name, port, _Free(), {})


def _out_of_balance(
    model: QuarterCar,
    p: Values,
    instant: NDArray[np.float64],
    s: Array,
    sd: Array,
    imposed: dict[str, Array] | None = None,
) -> Array:
    """The residual."""
    return _evaluated(model, p, section_curves(p), jnp.asarray(instant), s, sd, imposed)


# With the linkage compiled once for all models.
@eqx.filter_jit
def _evaluated(
    model: QuarterCar,
    p: Values,
    curves: SectionCurves,
    instant: Array,
    s: Array,
    sd: Array,
    imposed: dict[str, Array] | None,
) -> Array:
    inputs = inputs_of(instant)._replace(imposed=imposed)
    return model.residual(p, motion_of(instant), s, sd, inputs, curves)


def _lively() -> NDArray[np.float64]:
    """An instant at which every port moves."""
    instant = NOMINAL.copy()
    instant[:7] = 0.004, 0.05, 0.3, -0.7, 2.0, 9.0, 0.02
    return instant


def test_a_force_at_each_port_has_the_power_of_its_velocity(
    simqc: QuarterCar, numbers: dict[str, float]
) -> None:
    """Force times velocity of a port is what the force adds to the power of the generalised forces."""
    p, instant, model = as_values(numbers), _lively(), simqc
    for port in FORCE_PORTS:
        model = model + _probe(port, port.name)
    still = jnp.zeros(2 * len(FORCE_PORTS))
    bare = np.asarray(_out_of_balance(model, p, instant, still, still))
    for place, port in enumerate(FORCE_PORTS):
        pushed = still.at[2 * place + 1].set(FORCE)
        probed = np.asarray(_out_of_balance(model, p, instant, pushed, still))
        velocity = -probed[2 + 2 * place]
        power = (probed - bare)[:2] @ instant[2:4]
        assert abs(velocity) > 1e-3
        assert power == pytest.approx(FORCE * velocity, rel=1e-9), port


def test_a_force_from_outside_is_one_of_an_effect(simqc: QuarterCar, numbers: dict[str, float]) -> None:
    p, instant, model = as_values(numbers), _lively(), simqc
    for port in FORCE_PORTS:
        model = model + _probe(port, port.name)
    still = jnp.zeros(2 * len(FORCE_PORTS))
    for place, port in enumerate(FORCE_PORTS):
        pushed = still.at[2 * place + 1].set(FORCE)
        expected = np.asarray(_out_of_balance(model, p, instant, pushed, still))[:2]
        imposed = {port.name: jnp.asarray(port.sense * FORCE)}
        found = np.asarray(_out_of_balance(simqc, p, instant, jnp.zeros(0), jnp.zeros(0), imposed))
        np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.slow
@over("port", SERIES_PORTS, ids=lambda port: port.name)
def test_a_way_from_outside_is_one_of_an_effect(
    simtr: QuarterCar, numbers: dict[str, float], port: Port
) -> None:
    """And it moves the rig."""
    p, instant = as_values(numbers), _lively()
    s, sd, way = instant[:1] - 1e-6, np.zeros(1), np.array([2e-3, 0.05])
    model = simtr + yielding(port)
    expected = _out_of_balance(model, p, instant, np.append(s, way[0]), np.append(sd, way[1]))
    imposed = {port.name: jnp.asarray(way)}
    found = np.asarray(_out_of_balance(simtr, p, instant, s, sd, imposed))
    np.testing.assert_allclose(found, np.asarray(expected)[:3], rtol=1e-12)
    bare = np.asarray(_out_of_balance(simtr, p, instant, s, sd))
    assert np.max(np.abs(found - bare)) > 1e-3


def test_states_stay_in_the_order_of_the_effects_not_of_the_ports(
    simqc: QuarterCar, numbers: dict[str, float]
) -> None:
    """But for the rail's anchor, which is the model's own and comes first."""
    model = simqc + _probe(TYRE_LATERAL, "first") + CATALOGUE["tyre_friction"] + _probe(STRUT, "second")
    instant, p = draw_instants(1, 1)[0], as_values(numbers)
    s = jnp.array([1.0, 2.0, 3.0, 4.0])
    found = _out_of_balance(model, p, instant, s, jnp.zeros(4))
    assert [state.name for state in model.states] == ["velocity", "force"] * 2
    assert -np.asarray(found)[[3, 5]] == pytest.approx([20.0, 40.0])
    held = model + CATALOGUE["rail_coulomb"]
    found = _out_of_balance(held, p, instant, jnp.append(instant[:1], s), jnp.zeros(5))
    assert [state.name for state in held.states] == ["anchor", *["velocity", "force"] * 2]
    assert -np.asarray(found)[[4, 6]] == pytest.approx([20.0, 40.0])


def test_the_order_in_which_effects_are_added_does_not_matter(
    simqc: QuarterCar, simtr: QuarterCar, numbers: dict[str, float]
) -> None:
    p = as_values(numbers)
    other = simqc + CATALOGUE["tyre_friction"] + CATALOGUE["rail_coulomb"]
    for instant in draw_instants(4, 8):
        s = jnp.asarray(instant[:1])
        one, two = (_out_of_balance(model, p, instant, s, jnp.zeros(1)) for model in (simtr, other))
        assert np.array_equal(one, two)


def test_an_effect_is_added_once(simqc: QuarterCar) -> None:
    with pytest.raises(InputError, match="'rail_coulomb' is in the model already"):
        simqc + CATALOGUE["rail_coulomb"] + CATALOGUE["rail_coulomb"]
