"""A number that is another than the sheet's by a factor: a spring rate, a damping.

    n -> n (1 + e)

with the relative change e [1].

Source: Gillespie 1992, Fundamentals of Vehicle Dynamics, ch. 5, on rates.
"""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractNumberLaw, Port, Role


class Scale(AbstractNumberLaw):
    """A number that is larger or smaller by a share."""

    name: ClassVar[str] = "scale"
    words: ClassVar[str] = "a number that is larger or smaller than on the sheet"
    roles: ClassVar[tuple[Role, ...]] = (Role("number"), Role("change", 0.0))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """A tenth."""
        about = f"relative change of {port.numbers[0].name}"
        return {"change": Parameter("change", 0.1, "1", lower=-0.6, upper=1.5, about=about)}

    def changed(self, v: Values) -> Float[Array, ""]:
        """The number with its change [its unit]."""
        return v["number"] * (1.0 + v["change"])
