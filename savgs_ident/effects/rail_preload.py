"""Preload of the rail's carriages: friction that does not depend on what they carry.

    F = F_0

the same up and down. Carriages without play press on the rail by themselves.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractGrip, Grip, InternalState, Port, PortSignals
from savgs_ident.model.values import Values


class RailPreload(AbstractGrip):
    """Load-independent friction of the rail."""

    name: ClassVar[str] = "rail_preload"
    port: ClassVar[Port] = Port.RAIL
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "rail_preload_force",
            30.0,
            "N",
            lower=0.0,
            upper=3000.0,
            about="friction of the rail without load",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"rail_preload_force": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = "the sprung mass sticks at each reversal, however little the rail carries"
    reference: ClassVar[str] = (
        "Altintas et al. 2011, Machine tool feed drives, CIRP Annals 60(2), on preloaded guideways"
    )

    def grip(self, p: Values, signals: PortSignals) -> Grip:
        """The friction [N] in both directions."""
        force = p["rail_preload_force"] * jnp.ones_like(signals.load)
        return Grip(force, force)
