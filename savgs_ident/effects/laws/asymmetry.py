"""Friction that is higher one way than the other, about the same mean: a rail out of plumb, wipers with a lip.

    up: mu (1 + a) N        down: mu (1 - a) N

with the coefficient mu [1], the load N [N] and the asymmetry a [1]. The law is what differs from the mean.

Source: Armstrong-Helouvry 1991, Control of Machines with Friction.
"""

from collections.abc import Mapping
from typing import ClassVar

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractFrictionLimitLaw, FrictionLimit, Port, PortSignals, Role


class Asymmetry(AbstractFrictionLimitLaw):
    """More friction one way than the other."""

    name: ClassVar[str] = "asymmetry"
    words: ClassVar[str] = "more friction one way than the other"
    roles: ClassVar[tuple[Role, ...]] = (Role("coefficient"), Role("asymmetry", 0.0))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """A fifth of a coefficient of three hundredths."""
        about = "friction up over the mean of up and down, less one"
        return {
            "coefficient": 0.03,
            "asymmetry": Parameter("asymmetry", 0.2, "1", lower=-0.95, upper=0.95, about=about),
        }

    def suits(self, port: Port) -> bool:
        """Only where something sticks that carries a load."""
        return port.kind is self.kind and port.contact is not None and port.loaded

    def limit(self, v: Values, signals: PortSignals) -> FrictionLimit:
        """What comes up and goes down [N]."""
        share = v["coefficient"] * v["asymmetry"] * signals.load
        return FrictionLimit(share, -share)
