"""Coulomb friction in the joints of the wishbones, counted at the wheel.

    F = -F_c (x + T v) / x_0 held within -F_c .. F_c

with x [m] the stretch of a bristle (:mod:`savgs_ident.model.bristle`) along the suspension deflection, x_0
[m] how far it gives before it slides, and T [s] its damping over its stiffness.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.bristle import Bristle, Presliding, bristle
from savgs_ident.model.effect import AbstractForce, Grip, InternalState, Port, PortSignals
from savgs_ident.model.values import Values

STRETCH = 1e-4
"""How far the joints give before they slide [m]."""

LAG = 3e-3
"""Damping over stiffness of what sticks [s], as in the sheet's rail."""


class JointFriction(AbstractForce):
    """Friction of the joints against suspension travel."""

    name: ClassVar[str] = "joint_friction"
    port: ClassVar[Port] = Port.SUSPENSION
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "joint_friction_force",
            20.0,
            "N",
            lower=0.0,
            upper=3000.0,
            about="friction of the joints, at the wheel",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"joint_friction_force": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = (InternalState("joint_anchor", "m", 1e-2, slips=True),)
    symptom: ClassVar[str] = (
        "the suspension sticks where its deflection turns round: it moves too little at small roads"
    )
    reference: ClassVar[str] = (
        "Dupont, Hayward, Armstrong, Altpeter 2002, IEEE Transactions on Automatic Control 47(5)"
    )

    def _bristle(self, signals: PortSignals, state: Float[Array, " s"]) -> Bristle:
        """Bristle of unit grip: so it is one and the same at the null."""
        one = jnp.ones_like(signals.displacement)
        return bristle(Presliding(one / STRETCH, one * (LAG / STRETCH)), signals, Grip(one, one), state[0])

    def force(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The friction on the wheel [N]."""
        return p["joint_friction_force"] * self._bristle(signals, state).force

    def rate(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, " s"]:
        """The anchor's velocity [m/s]."""
        return self._bristle(signals, state).rate[None]
