"""Gain error of a sensor, beyond its tolerance.

    reading / truth = 1 + e

at every frequency, with the relative error e [1].

Source: ISO 16063-21, calibration of vibration transducers by comparison.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractSensorLaw, Family, Port, Role


class Gain(AbstractSensorLaw):
    """A sensor that shows too much or too little."""

    name: ClassVar[str] = "gain"
    words: ClassVar[str] = "a reading that is too large or too small"
    family: ClassVar[Family] = Family.GAIN
    roles: ClassVar[tuple[Role, ...]] = (Role("error", 0.0),)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """A twentieth."""
        about = "relative gain error of the sensor"
        return {"error": Parameter("error", 0.05, "1", lower=-0.9, upper=2.0, about=about)}

    def transfer(self, v: Values, frequency: Float[Array, "*f"]) -> Complex[Array, "*f"]:
        """Reading over truth at frequencies [Hz]."""
        gain = (1.0 + v["error"]) * jnp.ones_like(frequency)
        return gain.astype(jnp.complex128)
