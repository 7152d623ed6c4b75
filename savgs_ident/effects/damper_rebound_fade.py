"""A damper that loses force in extension alone: worn rebound valve, aeration, leakage.

    F = -f min(F_d, 0)

with F_d [N] the damper's push, which is negative where it is pulled out, and the faded share f [1].
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractForce, InternalState, Port, PortSignals
from savgs_ident.model.values import Values


class DamperReboundFade(AbstractForce):
    """Less damping in extension."""

    name: ClassVar[str] = "damper_rebound_fade"
    port: ClassVar[Port] = Port.STRUT
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "damper_rebound_fade",
            0.15,
            "1",
            lower=-1.0,
            upper=0.95,
            about="share of the rebound force that is lost",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"damper_rebound_fade": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = (
        "less damping in rebound than in bump: the body rides higher and even orders change"
    )
    reference: ClassVar[str] = "Dixon 2007, The Shock Absorber Handbook, on cavitation and leakage"

    def force(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """What the pulled damper lacks, pushing the strut apart [N]."""
        return -p["damper_rebound_fade"] * jnp.minimum(signals.load, 0.0)

    def rate(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, " s"]:
        """None: it follows the damper at once."""
        return jnp.zeros(0)
