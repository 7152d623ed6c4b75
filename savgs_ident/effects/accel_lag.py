"""Lag of the sprung-mass accelerometer: a first-order low-pass in its channel.

    reading / truth = 1 / (1 + 2 pi i f tau)

with the time constant tau [s].
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Complex, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractSensorFault, InternalState, Port
from savgs_ident.model.values import Values


class AccelLag(AbstractSensorFault):
    """An accelerometer that follows late."""

    name: ClassVar[str] = "accel_lag"
    port: ClassVar[Port] = Port.SENSOR_SPRUNG_ACCEL
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "accel_lag_time", 2e-3, "s", lower=0.0, upper=0.2, about="time constant of the accelerometer"
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"accel_lag_time": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = "the acceleration alone lags and shrinks with frequency; the deflection fits"
    reference: ClassVar[str] = "Doebelin 2004, Measurement Systems, ch. 3, first-order instruments"

    def transfer(self, p: Values, frequency: Float[Array, "*f"]) -> Complex[Array, "*f"]:
        """Reading over truth at frequencies [Hz]."""
        lag = 2.0 * jnp.pi * frequency * p["accel_lag_time"]
        return jnp.reciprocal(lax.complex(jnp.ones_like(lag), lag))
