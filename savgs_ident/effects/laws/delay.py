"""Delay of a sensor: a transmission or a filter in its channel.

    reading / truth = exp(-2 pi i f T)

with the frequency f [Hz] and the delay T [s].

Source: Oppenheim and Willsky 1997, Signals and Systems, ch. 4, time shifting.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Complex, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractSensorLaw, Family, Port, Role


class Delay(AbstractSensorLaw):
    """A sensor that reports late."""

    name: ClassVar[str] = "delay"
    words: ClassVar[str] = "a reading that comes late"
    family: ClassVar[Family] = Family.DYNAMICS
    roles: ClassVar[tuple[Role, ...]] = (Role("time", 0.0),)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """Two milliseconds on a time scale of 1."""
        usual, most = 2e-3 * port.time_scale, 0.2 * port.time_scale
        return {
            "time": Parameter(
                "time", usual, "s", lower=0.0, upper=most, about="delay of the sensor's channel"
            )
        }

    def transfer(self, v: Values, frequency: Float[Array, "*f"]) -> Complex[Array, "*f"]:
        """Reading over truth at frequencies [Hz]."""
        phase = -2.0 * jnp.pi * frequency * v["time"]
        return lax.complex(jnp.cos(phase), jnp.sin(phase))
