"""Rubber bushings of the wishbones: a spring beside the strut's, counted at the wheel.

    F = -k l_s

with the suspension deflection l_s [m]; unstrained in the drawing's nominal state.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractForce, InternalState, Port, PortSignals
from savgs_ident.model.values import Values


class BushingStiffness(AbstractForce):
    """A spring of the joints against suspension travel."""

    name: ClassVar[str] = "bushing_stiffness"
    port: ClassVar[Port] = Port.SUSPENSION
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "bushing_stiffness",
            1500.0,
            "N/m",
            lower=-20000.0,
            upper=60000.0,
            about="stiffness of the bushings, at the wheel",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"bushing_stiffness": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = "the resonance moves up as with a stiffer spring, but not with the link's angle"
    reference: ClassVar[str] = (
        "Blundell and Harty 2004, The Multibody Systems Approach to Vehicle Dynamics, on bushes"
    )

    def force(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The force on the wheel [N]."""
        return -p["bushing_stiffness"] * signals.displacement

    def rate(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, " s"]:
        """None: it follows the deflection at once."""
        return jnp.zeros(0)
