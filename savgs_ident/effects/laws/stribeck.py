"""Stribeck effect: a friction coefficient that rises at low speed.

    mu(v) = mu (1 + s exp(-(v / v_s)^2))

with the velocity v [m/s], the coefficient mu [1] of fast sliding, the rise s [1] over it and the Stribeck velocity
v_s [m/s]. The law is the share above the friction of fast sliding.

Source: Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7).
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractFrictionLimitLaw, FrictionLimit, Port, PortSignals, Role

COEFFICIENT = 0.03
"""Friction over load to which the rise refers where a plant names no coefficient of its own: a greased guide's."""


class Stribeck(AbstractFrictionLimitLaw):
    """More friction at low speed than at high speed."""

    name: ClassVar[str] = "stribeck"
    words: ClassVar[str] = "more friction at low speed than at high speed"
    roles: ClassVar[tuple[Role, ...]] = (Role("coefficient"), Role("rise", 0.0), Role("velocity"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """A tenth of a coefficient of three hundredths, at a quarter of the typical velocity."""
        speed, unit = port.velocity / 4.0, f"{port.displacement_unit}/s"
        about = f"rise of friction at rest, over that of a coefficient of {COEFFICIENT:g}"
        return {
            "coefficient": COEFFICIENT,
            "rise": Parameter("rise", 0.1, "1", lower=0.0, upper=5.0, about=about),
            "velocity": Parameter(
                "velocity", speed, unit, lower=speed / 40.0, upper=12.0 * speed, about="Stribeck velocity"
            ),
        }

    def suits(self, port: Port) -> bool:
        """Only where something sticks that carries a load."""
        return port.kind is self.kind and port.contact is not None and port.loaded

    def limit(self, v: Values, signals: PortSignals) -> FrictionLimit:
        """The share above the friction of fast sliding [N]."""
        rise = v["rise"] * jnp.exp(-((signals.velocity / v["velocity"]) ** 2))
        share = v["coefficient"] * rise * signals.load
        return FrictionLimit(share, share)
