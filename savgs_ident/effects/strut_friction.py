"""Coulomb friction of the strut's seals and rod guide.

    F = -F_c (x + T v) / x_0 held within -F_c .. F_c

with x [m] the stretch of a bristle (:mod:`savgs_ident.model.bristle`) along the strut, x_0 [m] how far it
gives before it slides, and T [s] its damping over its stiffness. The anchor counts from the strut's length in
the drawing's nominal state, so that it is small.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.bristle import Bristle, Presliding, bristle
from savgs_ident.model.effect import AbstractForce, Grip, InternalState, Port, PortSignals
from savgs_ident.model.kinematics import strut_length
from savgs_ident.model.values import Values

STRETCH = 1e-4
"""How far the seals give before they slide [m]."""

LAG = 3e-4
"""Damping over stiffness of what sticks [s]: little, for the damper is beside it."""


class StrutFriction(AbstractForce):
    """Friction of the strut's seals."""

    name: ClassVar[str] = "strut_friction"
    port: ClassVar[Port] = Port.STRUT
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "strut_friction_force", 30.0, "N", lower=0.0, upper=3000.0, about="friction of the strut's seals"
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"strut_friction_force": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = (InternalState("strut_anchor", "m", 1e-2, slips=True),)
    symptom: ClassVar[str] = "the strut sticks where it turns round: slow tests are stiffer than fast ones"
    reference: ClassVar[str] = "Dixon 2007, The Shock Absorber Handbook, on seal friction"

    def _bristle(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Bristle:
        """Bristle of unit grip: so it is one and the same at the null."""
        one = jnp.ones_like(signals.displacement)
        nominal = strut_length(p, jnp.zeros_like(one), p["psi_nominal"])
        moved = signals._replace(displacement=signals.displacement - nominal)
        return bristle(Presliding(one / STRETCH, one * (LAG / STRETCH)), moved, Grip(one, one), state[0])

    def force(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The friction that pushes the strut apart [N]."""
        return p["strut_friction_force"] * self._bristle(p, signals, state).force

    def rate(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, " s"]:
        """The anchor's velocity [m/s]."""
        return self._bristle(p, signals, state).rate[None]
