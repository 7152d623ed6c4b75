"""Lag of a sensor: a first-order low-pass in its channel.

    reading / truth = 1 / (1 + 2 pi i f tau)

with the frequency f [Hz] and the time constant tau [s].

Source: Doebelin 2004, Measurement Systems, ch. 3, first-order instruments.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Complex, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractSensorLaw, Family, Port, Role


class Lag(AbstractSensorLaw):
    """A sensor that follows late."""

    name: ClassVar[str] = "lag"
    words: ClassVar[str] = "a reading that follows late and shrinks with frequency"
    family: ClassVar[Family] = Family.DYNAMICS
    roles: ClassVar[tuple[Role, ...]] = (Role("time", 0.0),)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """Two milliseconds on a time scale of 1."""
        usual, most = 2e-3 * port.time_scale, 0.2 * port.time_scale
        return {
            "time": Parameter("time", usual, "s", lower=0.0, upper=most, about="time constant of the sensor")
        }

    def transfer(self, v: Values, frequency: Float[Array, "*f"]) -> Complex[Array, "*f"]:
        """Reading over truth at frequencies [Hz]."""
        lag = 2.0 * jnp.pi * frequency * v["time"]
        return jnp.reciprocal(lax.complex(jnp.ones_like(lag), lag))
