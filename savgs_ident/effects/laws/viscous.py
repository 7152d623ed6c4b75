"""Viscous damping: grease, wipers, oil.

    F = -c v

with the damping c [N s/m] and the port's velocity v [m/s].

Source: Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7).
"""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractForceLaw, Family, Port, PortSignals, Role, per


class Viscous(AbstractForceLaw):
    """A force against the velocity and in proportion to it."""

    name: ClassVar[str] = "viscous"
    words: ClassVar[str] = "damping in proportion to the velocity"
    family: ClassVar[Family] = Family.DAMPING
    roles: ClassVar[tuple[Role, ...]] = (Role("damping", 0.0),)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """A damping of the typical force at the typical velocity."""
        size, unit = port.force / port.velocity, per(f"{port.force_unit} s", port.displacement_unit)
        return {"damping": Parameter("damping", size, unit, lower=0.0, upper=100.0 * size, about="damping")}

    def force(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The damping force [N]."""
        return -v["damping"] * signals.velocity
