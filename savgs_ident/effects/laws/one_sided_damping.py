"""A damper that loses force where it is pulled: worn rebound valve, aeration, leakage.

    F = -f min(F_d, 0)

with the force F_d [N] of the plant's own damper, which is negative in rebound, and the share f [1] that is lost.

Source: Dixon 2007, The Shock Absorber Handbook, on cavitation and leakage.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractForceLaw, Family, Port, PortSignals, Role


class OneSidedDamping(AbstractForceLaw):
    """Less damping in extension than in compression."""

    name: ClassVar[str] = "one_sided"
    words: ClassVar[str] = "less damping in extension than in compression"
    family: ClassVar[Family] = Family.DAMPING
    roles: ClassVar[tuple[Role, ...]] = (Role("lost", 0.0),)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """A seventh of the rebound force."""
        about = "share of the rebound force that is lost"
        return {"lost": Parameter("lost", 0.15, "1", lower=-1.0, upper=0.95, about=about)}

    def suits(self, port: Port) -> bool:
        """Only where the plant has a damper."""
        return port.kind is self.kind and port.damped_at is not None

    def force(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """What the pulled damper lacks [N]."""
        return -v["lost"] * jnp.minimum(signals.load, 0.0)
