"""A tyre that stiffens as it is pressed in.

    F = k_t s c |c|

with the compression c [m] and the relative rise s [1/m] of the secant stiffness. The tangent stays positive
while 1 + 2 s c > 0.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractForce, InternalState, Port, PortSignals
from savgs_ident.model.values import Values


class TyreStiffening(AbstractForce):
    """A radial force that grows with the square of the compression."""

    name: ClassVar[str] = "tyre_stiffening"
    port: ClassVar[Port] = Port.TYRE_RADIAL
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "tyre_stiffening",
            5.0,
            "1/m",
            lower=-15.0,
            upper=100.0,
            about="rise of the tyre's secant stiffness per compression",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"tyre_stiffening": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = (
        "the tyre is stiffer in the valleys of the motion than on its crests: even orders of the acceleration"
    )
    reference: ClassVar[str] = (
        "Pacejka 2012, Tire and Vehicle Dynamics, ch. 4, vertical load against deflection"
    )

    def force(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The force on the wheel, away from the plate [N]."""
        squeeze = signals.displacement
        return p["k_t"] * p["tyre_stiffening"] * squeeze * jnp.abs(squeeze)

    def rate(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, " s"]:
        """None: it follows the compression at once."""
        return jnp.zeros(0)
