"""A number that is another than the sheet's by a difference: a payload, a zero error.

    n -> n + d

with the difference d, in the number's unit.

Source: Gillespie 1992, Fundamentals of Vehicle Dynamics, ch. 5, on masses.
"""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractNumberLaw, Port, Role


class Offset(AbstractNumberLaw):
    """A number with something added."""

    name: ClassVar[str] = "offset"
    words: ClassVar[str] = "a number that is larger or smaller than on the sheet"
    roles: ClassVar[tuple[Role, ...]] = (Role("number"), Role("change", 0.0))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """The typical change of the port's first number; its name is for whoever makes an effect of it."""
        name, unit, change, _ = port.numbers[0]
        most, about = 10.0 * abs(change), f"{name} beyond the sheet's"
        return {"change": Parameter("change", change, unit, lower=-most, upper=most, about=about)}

    def changed(self, v: Values) -> Float[Array, ""]:
        """The number and its change [its unit]."""
        return v["number"] + v["change"]
