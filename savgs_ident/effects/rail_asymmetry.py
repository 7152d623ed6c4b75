"""Rail friction that is higher one way than the other.

    up: mu_r (1 + a) load        down: mu_r (1 - a) load

with the asymmetry a [1]: a rail out of plumb, wipers with a lip.
"""

from collections.abc import Mapping
from typing import ClassVar

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractGrip, Grip, InternalState, Port, PortSignals
from savgs_ident.model.values import Values


class RailAsymmetry(AbstractGrip):
    """More rail friction up than down, about the same mean."""

    name: ClassVar[str] = "rail_asymmetry"
    port: ClassVar[Port] = Port.RAIL
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "rail_asymmetry",
            0.2,
            "1",
            lower=-0.95,
            upper=0.95,
            about="rail friction up over the mean of up and down, less one",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"rail_asymmetry": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = (
        "the acceleration steps more at one reversal than at the other: even orders appear"
    )
    reference: ClassVar[str] = "Armstrong-Helouvry 1991, Control of Machines with Friction"

    def grip(self, p: Values, signals: PortSignals) -> Grip:
        """What comes up and goes down [N]."""
        share = p["mu_r"] * p["rail_asymmetry"] * signals.load
        return Grip(share, -share)
