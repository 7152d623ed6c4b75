"""Lateral friction between tyre and plate, eq. (3) of the paper.

The wheel of a wishbone scrubs sideways when it travels. The friction grows with the scrub velocity and
saturates:

    F = -sign(ydot_H) min(1, |ydot_H| / ydot_Hth) mu_t |F_tz|

with ydot_H [m/s] the lateral velocity of the upright's material point at the contact H and ydot_Hth [m/s]
the velocity at which it saturates. Below that only the ratio mu_t / ydot_Hth matters.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractForce, InternalState, Port, PortSignals
from savgs_ident.model.values import Values


class TyreFriction(AbstractForce):
    """Lateral tyre friction with a shaping velocity."""

    name: ClassVar[str] = "tyre_friction"
    port: ClassVar[Port] = Port.TYRE_LATERAL
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("mu_t", 0.25, "1", lower=0.0, upper=2.0, about="tyre friction coefficient"),
        Parameter("ydot_Hth", 0.05, "m/s", lower=1e-3, upper=1.0, about="shaping velocity of tyre friction"),
    )
    null: ClassVar[Mapping[str, float]] = {"mu_t": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = (
        "the resonance is damped more at high scrub velocity; the rail load changes with it"
    )
    reference: ClassVar[str] = "Yu et al. 2017, eq. (3)"

    def force(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The friction on the upright [N], outward positive."""
        share = jnp.clip(signals.velocity / p["ydot_Hth"], -1.0, 1.0)
        return -share * p["mu_t"] * jnp.abs(signals.load)

    def rate(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, " s"]:
        """None: the friction follows the scrub velocity at once."""
        return jnp.zeros(0)
