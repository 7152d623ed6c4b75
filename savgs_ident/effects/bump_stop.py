"""Bump stop that the strut meets early: a spring that only pushes.

    F = k max(0, l_0 - g - l)

with the strut's length l [m], l_0 [m] that of the drawing's nominal state and the gap g [m] between the two.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractForce, InternalState, Port, PortSignals
from savgs_ident.model.kinematics import strut_length
from savgs_ident.model.values import Values


class BumpStop(AbstractForce):
    """A stop that shortens the strut's free travel."""

    name: ClassVar[str] = "bump_stop"
    port: ClassVar[Port] = Port.STRUT
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "bump_stop_stiffness", 2e5, "N/m", lower=0.0, upper=1e7, about="stiffness of the bump stop"
        ),
        Parameter(
            "bump_stop_gap",
            5e-3,
            "m",
            lower=0.0,
            upper=0.05,
            about="strut travel from the nominal state to the bump stop",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"bump_stop_stiffness": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = "near the resonance the deflection is cut off in bump; small motions fit"
    reference: ClassVar[str] = "Milliken and Milliken 1995, Race Car Vehicle Dynamics, on bump stops"

    def force(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The stop's push, which drives the strut apart [N]."""
        nominal = strut_length(p, jnp.zeros_like(signals.displacement), p["psi_nominal"])
        contact = nominal - p["bump_stop_gap"]
        return p["bump_stop_stiffness"] * jnp.maximum(contact - signals.displacement, 0.0)

    def rate(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, " s"]:
        """None: it follows the strut's length at once."""
        return jnp.zeros(0)
