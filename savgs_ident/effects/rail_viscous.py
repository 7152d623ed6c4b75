"""Viscous friction of the rail: grease and wipers.

    F = -c v

with the velocity v [m/s] of the sprung mass over the frame.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractForce, InternalState, Port, PortSignals
from savgs_ident.model.values import Values


class RailViscous(AbstractForce):
    """Friction of the rail in proportion to its velocity."""

    name: ClassVar[str] = "rail_viscous"
    port: ClassVar[Port] = Port.RAIL
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "rail_viscous_damping",
            60.0,
            "N s/m",
            lower=0.0,
            upper=5000.0,
            about="viscous damping of the rail",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"rail_viscous_damping": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = "the resonance is lower and nothing sticks: the waveform stays a sine"
    reference: ClassVar[str] = "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7)"

    def force(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The friction on the sprung mass [N]."""
        return -p["rail_viscous_damping"] * signals.velocity

    def rate(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, " s"]:
        """None: it follows the velocity at once."""
        return jnp.zeros(0)
