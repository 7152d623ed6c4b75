"""Coulomb friction of a contact in proportion to what it carries.

    F = mu N

the same both ways, with the coefficient mu [1] and the load N [N]. How the contact sticks before it slides is its own
(:func:`savgs_ident.effects.base.bristle`).

Source: Yu et al. 2017, eqs. (1)-(2).
"""

from collections.abc import Mapping
from typing import ClassVar

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractFrictionLimitLaw, FrictionLimit, Port, PortSignals, Role


class Coulomb(AbstractFrictionLimitLaw):
    """Friction in proportion to the load."""

    name: ClassVar[str] = "coulomb"
    words: ClassVar[str] = "friction in proportion to the load"
    roles: ClassVar[tuple[Role, ...]] = (Role("coefficient", 0.0),)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """A coefficient of three hundredths."""
        about = "friction coefficient"
        return {"coefficient": Parameter("coefficient", 0.03, "1", lower=0.0, upper=0.5, about=about)}

    def suits(self, port: Port) -> bool:
        """Only where something sticks that carries a load."""
        return port.kind is self.kind and port.contact is not None and port.loaded

    def limit(self, v: Values, signals: PortSignals) -> FrictionLimit:
        """The friction [N] in both directions."""
        slide = v["coefficient"] * signals.load
        return FrictionLimit(slide, slide)
