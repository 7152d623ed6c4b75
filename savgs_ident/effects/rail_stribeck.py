"""Stribeck effect of the rail: its friction coefficient rises at low speed.

    mu(v) = mu_r (1 + s exp(-(v / v_s)^2))

with the rise s [1] over the friction of fast sliding and the Stribeck velocity v_s [m/s].
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractGrip, Grip, InternalState, Port, PortSignals
from savgs_ident.model.values import Values


class RailStribeck(AbstractGrip):
    """More rail friction at low speed than at high speed."""

    name: ClassVar[str] = "rail_stribeck"
    port: ClassVar[Port] = Port.RAIL
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("stribeck_rise", 0.1, "1", lower=0.0, upper=5.0, about="rise of rail friction at rest"),
        Parameter(
            "stribeck_velocity", 0.08, "m/s", lower=2e-3, upper=1.0, about="Stribeck velocity of the rail"
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"stribeck_rise": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = (
        "friction is highest where the body turns round: slow tests stick more than fast ones"
    )
    reference: ClassVar[str] = "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7)"

    def grip(self, p: Values, signals: PortSignals) -> Grip:
        """The share above the friction of fast sliding [N]."""
        rise = p["stribeck_rise"] * jnp.exp(-((signals.velocity / p["stribeck_velocity"]) ** 2))
        share = p["mu_r"] * rise * signals.load
        return Grip(share, share)
