"""An input that moves more or less than its encoder says.

    u = (1 + e) recorded u

with the relative error e [1].

Source: Doebelin 2004, Measurement Systems, ch. 3, static calibration.
"""

from collections.abc import Mapping
from typing import ClassVar

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractInputLaw, Family, Fundamental, InputSignal, Port, Role


class InputScale(AbstractInputLaw):
    """A scale error of what is recorded of an input."""

    name: ClassVar[str] = "scale"
    words: ClassVar[str] = "an input that is larger or smaller than recorded"
    family: ClassVar[Family] = Family.GAIN
    roles: ClassVar[tuple[Role, ...]] = (Role("error", 0.0),)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """Three hundredths."""
        return {"error": Parameter("error", 0.03, "1", lower=-0.5, upper=0.5, about="relative error")}

    def shift(self, v: Values, signal: InputSignal, fundamental: Fundamental) -> InputSignal:
        """What the input does beyond its encoder's reading."""
        return InputSignal(v["error"] * signal.value, v["error"] * signal.rate)
