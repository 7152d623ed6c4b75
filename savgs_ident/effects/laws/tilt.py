"""A sensor that is not upright: it sees the share of the motion along its axis.

    reading / truth = cos(tilt) = 1 - v

with the versine v = 1 - cos(tilt) [1], in which the reading is linear; 0.0075 is 7 deg, and hardly anyone mounts a
sensor further off. It looks like a gain below one, and nothing in the readings can distinguish the two.

Source: Titterton and Weston 2004, Strapdown Inertial Navigation Technology, on misalignment.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractSensorLaw, Family, Port, Role


class Tilt(AbstractSensorLaw):
    """A tilted sensor."""

    name: ClassVar[str] = "tilt"
    words: ClassVar[str] = "a sensor that is tilted"
    family: ClassVar[Family] = Family.GAIN
    roles: ClassVar[tuple[Role, ...]] = (Role("versine", 0.0),)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """Seven degrees."""
        about = "one less the cosine of the sensor's tilt"
        return {"versine": Parameter("versine", 0.0075, "1", lower=0.0, upper=0.5, about=about)}

    def suits(self, port: Port) -> bool:
        """Nowhere without more than a port declares: it is a gain below one."""
        return False

    def transfer(self, v: Values, frequency: Float[Array, "*f"]) -> Complex[Array, "*f"]:
        """Reading over truth at frequencies [Hz]."""
        cosine = (1.0 - v["versine"]) * jnp.ones_like(frequency)
        return cosine.astype(jnp.complex128)
