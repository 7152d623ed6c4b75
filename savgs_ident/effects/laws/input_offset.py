"""A constant force beside what a drive is said to exert: an offset of its amplifier, a weight to be held.

    u = recorded u + b

with the offset b in the unit of the input: N, N m, or what a motor is driven with, as A or V.

Source: Janot, Gautier and Brunot 2019, Data set and reference models of EMPS, nonlinearbenchmark.org, eq. (1).
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractInputLaw, Family, Fundamental, InputSignal, Port, PortKind, Role

MOTIONS = ("m", "m/s", "m/s^2", "rad", "rad/s", "rad/s^2")
"""Units of what is moved, not driven."""


class InputOffset(AbstractInputLaw):
    """A constant error of a drive that is recorded as an input."""

    name: ClassVar[str] = "offset"
    words: ClassVar[str] = "a constant error of the input"
    family: ClassVar[Family] = Family.SHAPE
    roles: ClassVar[tuple[Role, ...]] = (Role("force", 0.0),)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """The typical size of the input."""
        size = port.displacement
        about = "constant force beside the recorded one"
        return {
            "force": Parameter(
                "force", size, port.displacement_unit, lower=-100.0 * size, upper=100.0 * size, about=about
            )
        }

    def suits(self, port: Port) -> bool:
        """Only where the input is no motion: a road that lies higher is the same road."""
        return port.kind is PortKind.INPUT and port.displacement_unit not in MOTIONS

    def shift(self, v: Values, signal: InputSignal, fundamental: Fundamental) -> InputSignal:
        """The constant."""
        return InputSignal(v["force"] * jnp.ones_like(signal.value), jnp.zeros_like(signal.rate))
