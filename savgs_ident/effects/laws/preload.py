"""Friction of a preloaded contact, which does not depend on what it carries.

    F = F_0

the same both ways, with the force F_0 [N]. Carriages without play press on their rail by themselves.

Source: Altintas et al. 2011, Machine tool feed drives, CIRP Annals 60(2), on preloaded guideways.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractFrictionLimitLaw, FrictionLimit, Port, PortSignals, Role


class Preload(AbstractFrictionLimitLaw):
    """Friction that does not depend on the load."""

    name: ClassVar[str] = "preload"
    words: ClassVar[str] = "friction that does not depend on the load"
    roles: ClassVar[tuple[Role, ...]] = (Role("force", 0.0),)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """The typical force."""
        about = "friction without load"
        return {
            "force": Parameter(
                "force", port.force, port.force_unit, lower=0.0, upper=100.0 * port.force, about=about
            )
        }

    def limit(self, v: Values, signals: PortSignals) -> FrictionLimit:
        """The friction [N] in both directions."""
        force = v["force"] * jnp.ones_like(signals.load)
        return FrictionLimit(force, force)
