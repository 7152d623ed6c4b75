"""Ports of the rig: where a force acts, with what power, and how effects add up."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.effects.rail_coulomb import RailCoulomb
from savgs_ident.effects.tyre_friction import TyreFriction
from savgs_ident.model.effect import AbstractEffect, InternalState, Port, PortSignals
from savgs_ident.model.quarter_car import HANDLED_PORTS, QuarterCar
from savgs_ident.model.sensors import read_sensors
from savgs_ident.model.values import Values

from .instants import NOMINAL, as_values, draw_instants, inputs_of, motion_of

FORCE = 7.0
WITH_THE_VELOCITY = {Port.TYRE_RADIAL: -1.0}
"""Power into the rig per force and velocity, where it is not 1: the tyre pushes against compression."""


class _Probe(AbstractEffect):
    """A force at a port as its second state says; the rates of its states show what the port shows."""

    port: Port = eqx.field(static=True)
    name: str = eqx.field(static=True)
    parameters = ()
    null: ClassVar[dict[str, float]] = {}
    states = (InternalState("velocity", "m/s", 1.0), InternalState("force", "N", 1.0))
    symptom = "none"
    reference = "none"

    def force(self, p: Values, signals: PortSignals, state: Array) -> Array:
        return state[1]

    def rate(self, p: Values, signals: PortSignals, state: Array) -> Array:
        return jnp.stack([signals.velocity, 10.0 * state[1]])


@eqx.filter_jit
def _out_of_balance(model: QuarterCar, p: Values, instant: NDArray[np.float64], s: Array) -> Array:
    instant = jnp.asarray(instant)
    return model.residual(p, motion_of(instant), s, jnp.zeros_like(s), inputs_of(instant))


def test_a_force_at_each_port_has_the_power_of_its_velocity(
    simqc: QuarterCar, numbers: dict[str, float]
) -> None:
    """Force times velocity of a port is what the force adds to the power of the generalised forces."""
    p = as_values(numbers)
    instant = NOMINAL.copy()
    instant[:6] = 0.004, 0.05, 0.3, -0.7, 2.0, 9.0
    instant[6] = 0.02
    model = simqc
    for port in HANDLED_PORTS:
        model = model + _Probe(port, port.value)
    states = jnp.zeros(2 * len(HANDLED_PORTS))
    bare = np.asarray(_out_of_balance(model, p, instant, states))
    for place, port in enumerate(HANDLED_PORTS):
        probed = np.asarray(_out_of_balance(model, p, instant, states.at[2 * place + 1].set(FORCE)))
        velocity = -probed[2 + 2 * place]
        power = (probed - bare)[:2] @ instant[2:4]
        assert abs(velocity) > 1e-3
        assert power == pytest.approx(WITH_THE_VELOCITY.get(port, 1.0) * FORCE * velocity, rel=1e-9), port


def test_states_stay_in_the_order_of_the_effects_not_of_the_ports(
    simqc: QuarterCar, numbers: dict[str, float]
) -> None:
    model = simqc + _Probe(Port.RAIL, "first") + TyreFriction() + _Probe(Port.STRUT, "second")
    s = jnp.array([1.0, 2.0, 3.0, 4.0])
    found = _out_of_balance(model, as_values(numbers), draw_instants(1, 1)[0], s)
    assert [state.name for state in model.states] == ["velocity", "force"] * 2
    assert -np.asarray(found)[[3, 5]] == pytest.approx([20.0, 40.0])


def test_the_order_in_which_effects_are_added_does_not_matter(
    simqc: QuarterCar, simtr: QuarterCar, numbers: dict[str, float]
) -> None:
    p = as_values(numbers)
    other = simqc + TyreFriction() + RailCoulomb()
    for instant in draw_instants(4, 8):
        s = jnp.asarray(instant[:1])
        one, two = (_out_of_balance(model, p, instant, s) for model in (simtr, other))
        assert np.array_equal(one, two)


def test_an_effect_is_added_once_and_where_a_force_can_act(simqc: QuarterCar) -> None:
    with pytest.raises(InputError, match="'rail_coulomb' is in the model already"):
        simqc + RailCoulomb() + RailCoulomb()
    with pytest.raises(InputError, match=r"tilted: no force can act at port 'sensor\.sprung_accel'"):
        simqc + _Probe(Port.SENSOR_SPRUNG_ACCEL, "tilted")


def test_sensors_show_acceleration_and_deflection_times_their_gains(numbers: dict[str, float]) -> None:
    p = as_values(numbers | {"accel_gain": 1.02, "deflection_gain": 0.98})
    angle, acceleration = np.float64(0.03), np.float64(-2.5)
    true = read_sensors(as_values(numbers), angle, acceleration)
    seen = read_sensors(p, angle, acceleration)
    assert float(true.sprung_accel) == -2.5
    assert float(true.susp_deflection) == pytest.approx(0.03 * 0.37, rel=0.01)
    assert float(seen.sprung_accel) == pytest.approx(-2.5 * 1.02, rel=1e-15)
    assert float(seen.susp_deflection) == pytest.approx(0.98 * float(true.susp_deflection), rel=1e-15)
    rest = read_sensors(as_values(numbers), np.float64(0.0), np.float64(0.0))
    assert float(rest.susp_deflection) == pytest.approx(0.0, abs=1e-15)
