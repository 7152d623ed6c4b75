"""Delay of the suspension potentiometer: a transmission or a filter in its channel.

    reading / truth = exp(-2 pi i f T)

with the delay T [s].
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Complex, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractSensorFault, InternalState, Port
from savgs_ident.model.values import Values


class DeflectionDelay(AbstractSensorFault):
    """A potentiometer that reports late."""

    name: ClassVar[str] = "deflection_delay"
    port: ClassVar[Port] = Port.SENSOR_SUSP_DEFLECTION
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "deflection_delay_time",
            2e-3,
            "s",
            lower=0.0,
            upper=0.2,
            about="delay of the potentiometer's channel",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"deflection_delay_time": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = "the deflection alone lags, in proportion to the frequency, and keeps its size"
    reference: ClassVar[str] = "Oppenheim and Willsky 1997, Signals and Systems, ch. 4, time shifting"

    def transfer(self, p: Values, frequency: Float[Array, "*f"]) -> Complex[Array, "*f"]:
        """Reading over truth at frequencies [Hz]."""
        phase = -2.0 * jnp.pi * frequency * p["deflection_delay_time"]
        return lax.complex(jnp.cos(phase), jnp.sin(phase))
