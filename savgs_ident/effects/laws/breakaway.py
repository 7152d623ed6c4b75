"""Friction without load that is greater at low speed: what a preloaded bearing, a seal or a sleeve breaks away from.

    F(v) = F_0 (1 + s exp(-(v / v_s)^2))

the same both ways, with the velocity v [m/s], the friction F_0 [N] of fast sliding, the rise s [1] over it and the
Stribeck velocity v_s [m/s]. Of a port that carries a load this is what :mod:`savgs_ident.effects.laws.stribeck` adds
to a coefficient of friction.

Source: Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7).
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractFrictionLimitLaw, FrictionLimit, Port, PortSignals, Role


class Breakaway(AbstractFrictionLimitLaw):
    """Friction that does not depend on the load and is greater at low speed than at high speed."""

    name: ClassVar[str] = "breakaway"
    words: ClassVar[str] = "friction that does not depend on the load and is greater at low speed"
    roles: ClassVar[tuple[Role, ...]] = (Role("force", 0.0), Role("rise"), Role("velocity"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """The typical force, half as much more at rest, at a quarter of the typical velocity.

        At more than half of that nothing of the motion were fast sliding, and the law a negative damping.
        """
        force, speed = port.force, port.velocity / 4.0
        return {
            "force": Parameter(
                "force",
                force,
                port.force_unit,
                lower=0.0,
                upper=100.0 * force,
                about="friction of fast sliding",
            ),
            "rise": Parameter(
                "rise", 0.5, "1", lower=0.02, upper=10.0, about="rise of friction at rest over that"
            ),
            "velocity": Parameter(
                "velocity",
                speed,
                f"{port.displacement_unit}/s",
                lower=speed / 40.0,
                upper=2.0 * speed,
                about="Stribeck velocity",
            ),
        }

    def suits(self, port: Port) -> bool:
        """Only where something sticks that carries no load."""
        return port.kind is self.kind and port.contact is not None and not port.loaded

    def limit(self, v: Values, signals: PortSignals) -> FrictionLimit:
        """The friction [N] in both directions."""
        force = v["force"] * (1.0 + v["rise"] * jnp.exp(-((signals.velocity / v["velocity"]) ** 2)))
        return FrictionLimit(force, force)
